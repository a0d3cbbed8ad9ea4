//! The list of scenes: a TOML file to what is to be done. All of it is checked before any work: keys, values, files that two
//! scenes would write.

use crate::cli;
use localprt_precompute::error::{CommandError, Exit};
use localprt_precompute::inputs::{self, BUILTIN};
use localprt_precompute::output::folder_of;
use localprt_precompute::settings::{BakeSettings, OPTIONS, Preset, nearest, parse};
use localprt_scenes::Lighting;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Folder of the outputs, unless one is named.
const OUTPUT: &str = "baked";
/// Keys that scenes and defaults have besides the options of a bake.
const SHARED_KEYS: [&str; 6] = ["preset", "cache", "cache_limit", "output", "lights", "validate"];
/// Keys that only a scene has.
const SCENE_KEYS: [&str; 2] = ["name", "scene"];
const HELP: &str = "docs/batch.md has all keys and an example";

/// A list of scenes, every option of it checked.
#[derive(Debug)]
pub struct Plan {
    /// The file.
    pub list: PathBuf,
    /// Its folder, where paths in it start and where commands run.
    pub root: PathBuf,
    /// Folder of the index, from there.
    pub output: PathBuf,
    /// In the order of the file.
    pub scenes: Vec<Job>,
}

/// One scene: what is baked how and into what. Paths start at the folder of the list.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Name of its outputs.
    pub name: String,
    /// `.gltf`, `.glb` or `builtin:NAME`.
    pub source: String,
    /// Folder of its outputs.
    pub folder: PathBuf,
    /// Options of the bake.
    pub settings: BakeSettings,
    /// Flags of the bake that say where results are kept.
    pub cache: Vec<String>,
    /// Validation; `None` without.
    pub validation: Option<Validation>,
}

/// How a scene is validated.
#[derive(Clone, Debug, PartialEq)]
pub struct Validation {
    /// Lighting files; without any, the scene's own light.
    pub lights: Vec<PathBuf>,
    /// Options as flags of `validate`.
    pub flags: Vec<String>,
    /// Largest figures allowed, by the key of the limit without `max_`.
    pub limits: BTreeMap<String, f64>,
}

impl Plan {
    /// Reads a list.
    ///
    /// # Errors
    /// The first thing that is wrong, with the scene or table and the key.
    pub fn read(list: &Path) -> Result<Self, CommandError> {
        let text = inputs::text(list)?;
        let root = folder_of(list);
        let plan = of_text(list, root, &text).map_err(|error| error.in_file(list))?;
        plan.check_outputs().map_err(|error| error.in_file(list))?;
        Ok(plan)
    }

    /// Folder of the index, from the current folder.
    pub fn index_folder(&self) -> PathBuf {
        if self.root == Path::new(".") { self.output.clone() } else { self.root.join(&self.output) }
    }

    /// Refuses two scenes that would write one file, and a scene that would write over an input.
    fn check_outputs(&self) -> Result<(), CommandError> {
        let mut inputs = BTreeSet::from([same_place(&self.list)]);
        let mut written: BTreeMap<PathBuf, &str> = BTreeMap::new();
        for job in &self.scenes {
            inputs.extend(job.input_files(&self.root).iter().map(|path| same_place(path)));
        }
        for job in &self.scenes {
            let refused = |what: String| {
                let help = "give the scene another `name` or `output`";
                Err(CommandError::new(Exit::Usage, format!("scene `{}`: {what}", job.name)).help(help))
            };
            for path in job.outputs() {
                let place = same_place(&self.root.join(&path));
                if let Some(other) = written.insert(place.clone(), &job.name) {
                    return refused(format!("{} is also an output of scene `{other}`", path.display()));
                }
                // A bake keeps clear of its own scene: `hall.glb` is baked beside itself into `hall.lightmap.glb`.
                let is_own = same_place(&self.root.join(&job.source)) == place && path != job.baked();
                if inputs.contains(&place) && !is_own {
                    return refused(format!("{} would be written over an input", path.display()));
                }
            }
        }
        Ok(())
    }
}

impl Job {
    /// The baked file.
    pub fn baked(&self) -> PathBuf {
        self.beside("lprt")
    }

    /// What the commands said.
    pub fn log(&self) -> PathBuf {
        self.beside("log")
    }

    /// Report of the bake.
    pub fn report(&self) -> PathBuf {
        self.beside("report.json")
    }

    /// Options in force, for `bake --config`.
    pub fn options(&self) -> PathBuf {
        self.beside("options.toml")
    }

    /// Folder of the validation.
    pub fn quality(&self) -> PathBuf {
        self.folder.join(format!("{}-quality", self.name))
    }

    /// All that it writes, or may write.
    fn outputs(&self) -> Vec<PathBuf> {
        let scenes = ["glb", "lightmap.glb", "reference.ply"].map(|extension| self.beside(extension));
        let own = [self.baked(), self.log(), self.report(), self.options(), self.quality()];
        scenes.into_iter().chain(own).collect()
    }

    fn beside(&self, extension: &str) -> PathBuf {
        self.folder.join(format!("{}.{extension}", self.name))
    }

    /// The files that it is made from, as a path from here: scene, what the scene names, lighting, skies.
    pub fn input_files(&self, root: &Path) -> Vec<PathBuf> {
        let mut files = Vec::new();
        if !self.source.starts_with(BUILTIN) {
            let scene = root.join(&self.source);
            files.extend(localprt_scenes::linked_files(&scene));
            files.push(scene);
        }
        files.extend(self.lighting_files(root));
        files
    }

    /// Those of them that only its validation depends on.
    pub fn lighting_files(&self, root: &Path) -> Vec<PathBuf> {
        let lights = self.validation.iter().flat_map(|validation| &validation.lights).map(|path| root.join(path));
        lights.flat_map(|path| [Lighting::sky_image_of(&path), Some(path)]).flatten().collect()
    }
}

fn of_text(list: &Path, root: &Path, text: &str) -> Result<Plan, CommandError> {
    let name = list.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut table = parse(&name, text).map_err(|error| {
        let what = error.to_string();
        CommandError::new(Exit::Usage, what.strip_prefix(&format!("{name}: ")).unwrap_or(&what)).help(HELP)
    })?;
    let defaults = table.remove("defaults").unwrap_or_else(|| Value::Table(Table::new()));
    let scenes = table.remove("scene");
    if let Some(key) = table.keys().next() {
        return Err(unknown("at the top", key, ["defaults", "scene"].into_iter()));
    }
    let defaults = Entry::new("[defaults]", defaults, &SHARED_KEYS)?;
    // By itself, so that a mistake in it is not told of a scene.
    defaults.settings()?;
    defaults.validation()?;
    let Some(Value::Array(scenes)) = scenes.filter(|scenes| scenes.as_array().is_some_and(|list| !list.is_empty()))
    else {
        let what = "there is no scene";
        return Err(CommandError::new(Exit::Usage, what).help("add one: [[scene]] with scene = \"hall.glb\""));
    };
    let job = |(index, scene)| Job::of(index, scene, &defaults);
    let scenes = scenes.into_iter().enumerate().map(job).collect::<Result<Vec<_>, _>>()?;
    let output = PathBuf::from(defaults.text("output")?.unwrap_or_else(|| OUTPUT.into()));
    Ok(Plan { list: list.to_owned(), root: root.to_owned(), output, scenes })
}

impl Job {
    fn of(index: usize, scene: Value, defaults: &Entry) -> Result<Self, CommandError> {
        let given = |key: &str| scene.get(key).and_then(Value::as_str).map(str::to_owned);
        let name = given("name").or_else(|| {
            let source = given("scene")?;
            let stem = Path::new(source.strip_prefix(BUILTIN).unwrap_or(&source)).file_stem()?;
            Some(stem.to_string_lossy().into_owned())
        });
        let place = name.as_ref().map_or_else(|| format!("scene {}", index + 1), |name| format!("scene `{name}`"));
        let own = Entry::new(&place, scene, &[&SCENE_KEYS[..], &SHARED_KEYS].concat())?;
        let (Some(source), Some(name)) = (own.text("scene")?, name) else {
            let help = "add scene = \"FILE.glb\", or \"builtin:cornell\"";
            return Err(CommandError::new(Exit::Usage, format!("{place}: which one is not said")).help(help));
        };
        if name.is_empty() || name.starts_with('.') || name.contains(['/', '\\']) {
            let help = "outputs are named after it: give it letters, digits and dashes, without folders";
            return Err(CommandError::new(Exit::Usage, format!("{place}: the name cannot be a file's")).help(help));
        }
        own.text("name")?;
        let all = own.over(defaults);
        let folder = PathBuf::from(all.text("output")?.unwrap_or_else(|| OUTPUT.into()));
        let (settings, cache, validation) = (all.settings()?, all.cache()?, all.validation()?);
        Ok(Self { name, source, folder, settings, cache, validation })
    }
}

/// A table of the list, with the name that errors have for it.
struct Entry {
    place: String,
    table: Table,
}

impl Entry {
    /// Refuses what is no table, and keys that are neither `known` nor options of a bake.
    fn new(place: &str, value: Value, known: &[&str]) -> Result<Self, CommandError> {
        let Value::Table(table) = value else {
            let what = format!("{place}: is not a table of keys");
            return Err(CommandError::new(Exit::Usage, what).help(HELP));
        };
        let names = || known.iter().copied().chain(OPTIONS.iter().map(|option| option.key));
        match table.keys().find(|key| !names().any(|name| name == *key)) {
            Some(key) => Err(unknown(place, key, names())),
            None => Ok(Self { place: place.to_owned(), table }),
        }
    }

    /// The same with what it does not have from the defaults; validation key by key.
    fn over(self, defaults: &Self) -> Self {
        let mut table = defaults.table.clone();
        let both = (defaults.table.get("validate"), self.table.get("validate"));
        let validate = match both {
            (Some(Value::Table(below)), Some(Value::Table(above))) => {
                let mut merged = below.clone();
                merged.extend(above.clone());
                Some(Value::Table(merged))
            }
            (Some(below @ Value::Table(_)), Some(Value::Boolean(true))) => Some(below.clone()),
            _ => None,
        };
        table.extend(self.table);
        table.extend(validate.map(|validate| ("validate".to_owned(), validate)));
        Self { place: self.place, table }
    }

    fn wrong(&self, key: &str, expected: &str) -> CommandError {
        CommandError::new(Exit::Usage, format!("{}: `{key}` is not {expected}", self.place)).help(HELP)
    }

    fn text(&self, key: &str) -> Result<Option<String>, CommandError> {
        match self.table.get(key) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text.clone())),
            Some(_) => Err(self.wrong(key, "a text")),
        }
    }

    /// One text, or a list of them.
    fn texts(&self, key: &str) -> Result<Vec<String>, CommandError> {
        let wrong = || self.wrong(key, "a path, or a list of paths");
        match self.table.get(key) {
            None => Ok(Vec::new()),
            Some(Value::String(text)) => Ok(vec![text.clone()]),
            Some(Value::Array(list)) => {
                list.iter().map(|text| text.as_str().map(str::to_owned).ok_or_else(wrong)).collect()
            }
            Some(_) => Err(wrong()),
        }
    }

    fn settings(&self) -> Result<BakeSettings, CommandError> {
        let preset = match self.table.get("preset") {
            None => Preset::Production,
            Some(value) => value.clone().try_into::<Preset>().map_err(|_| {
                let names: Vec<&str> = Preset::WORDS.iter().map(|(name, _)| *name).collect();
                self.wrong("preset", &format!("one of {}", names.join(", ")))
            })?,
        };
        let is_option = |key: &String| OPTIONS.iter().any(|option| option.key == key);
        let options: Table = self.table.iter().filter(|(key, _)| is_option(key)).map(own_pair).collect();
        let error = match BakeSettings::resolve(preset, Some((&self.place, &options.to_string())), &Table::new()) {
            Ok(settings) => return Ok(settings),
            Err(error) => error,
        };
        Err(CommandError::new(Exit::Usage, error.to_string()).help("`precompute bake --help` tells what it is for"))
    }

    fn cache(&self) -> Result<Vec<String>, CommandError> {
        let mut flags = match self.table.get("cache") {
            None | Some(Value::Boolean(true)) => Vec::new(),
            Some(Value::Boolean(false)) => return Ok(vec!["--no-cache".into()]),
            Some(Value::String(place)) => vec![format!("--cache={place}")],
            Some(_) => return Err(self.wrong("cache", "a folder, true or false")),
        };
        match self.table.get("cache_limit") {
            None => {}
            Some(Value::Integer(bytes)) if *bytes >= 0 => flags.push(format!("--cache-limit={bytes}")),
            Some(_) => return Err(self.wrong("cache_limit", "a number of bytes")),
        }
        Ok(flags)
    }

    /// `None` where there is to be none.
    fn validation(&self) -> Result<Option<Validation>, CommandError> {
        let table = match self.table.get("validate") {
            None | Some(Value::Boolean(false)) => return Ok(None),
            Some(Value::Boolean(true)) => &Table::new(),
            Some(Value::Table(table)) => table,
            Some(_) => return Err(self.wrong("validate", "a table of its options, true or false")),
        };
        let (place, known) = (format!("{}: validate", self.place), cli::Validate::keys());
        let (mut flags, mut limits) = (Vec::new(), BTreeMap::new());
        for (key, value) in table {
            if !known.contains(key) {
                return Err(unknown(&place, key, known.iter().map(String::as_str)));
            }
            if let Some(name) = key.strip_prefix("max_") {
                let limit = value.as_float().or_else(|| value.as_integer().map(|number| number as f64));
                limits.extend(limit.map(|limit| (name.to_owned(), limit)));
            }
            let flag = format!("--{}", key.replace('_', "-"));
            match value {
                Value::Boolean(is_set) => flags.extend(is_set.then_some(flag)),
                Value::Array(list) => flags.extend(list.iter().map(|value| format!("{flag}={}", plain(value)))),
                value => flags.push(format!("{flag}={}", plain(value))),
            }
        }
        cli::Validate::check(&flags).map_err(|what| {
            let help = "`precompute validate --help` tells what it is for";
            CommandError::new(Exit::Usage, format!("{place}: {what}")).help(help)
        })?;
        let lights = self.texts("lights")?.into_iter().map(PathBuf::from).collect();
        Ok(Some(Validation { lights, flags, limits }))
    }
}

fn own_pair((key, value): (&String, &Value)) -> (String, Value) {
    (key.clone(), value.clone())
}

fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

fn unknown<'a>(place: &str, key: &str, known: impl Iterator<Item = &'a str>) -> CommandError {
    let help = nearest(key, known).map_or_else(|| HELP.into(), |name| format!("did you mean `{name}`?"));
    CommandError::new(Exit::Usage, format!("{place}: unknown key `{key}`")).help(help)
}

/// The same for all spellings of a path, also of one that is not there.
fn same_place(path: &Path) -> PathBuf {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    if let Ok(real) = whole.canonicalize() {
        return real;
    }
    match (whole.parent(), whole.file_name()) {
        (Some(folder), Some(name)) => same_place(folder).join(name),
        // It ends with `..`.
        (Some(folder), None) => folder.parent().map_or_else(PathBuf::new, same_place),
        (None, _) => whole,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Plan, CommandError> {
        let folder = tempfile::tempdir().expect("folder");
        let list = folder.path().join("levels.toml");
        std::fs::write(&list, text).expect("written");
        Plan::read(&list)
    }

    fn refused(text: &str) -> String {
        let error = read(text).expect_err("to be refused");
        assert_eq!(error.exit, Exit::Usage, "{error}");
        let (_, said) = error
            .to_string()
            .split_once("levels.toml: ")
            .map(|(a, b)| (a.to_owned(), b.to_owned()))
            .expect("names the file");
        said
    }

    #[test]
    fn scenes_have_options_of_their_own_over_shared_ones() {
        let plan = read(
            r#"
            [defaults]
            preset = "preview"
            probes = 50
            gather_rays = 100
            output = "out"
            cache = "kept"
            lights = "noon.json"
            validate = { receivers = 64, max_nrmse = 0.1, failure_case = true }
            [[scene]]
            scene = "levels/hall.gltf"
            gather_rays = 200
            validate = { max_nrmse = 0.2, sweep = ["degree=1,2"] }
            [[scene]]
            name = "box"
            scene = "builtin:cornell"
            lights = ["a.json", "b.json"]
            cache = false
            output = "elsewhere"
            validate = false
            [[scene]]
            scene = "builtin:atrium"
            validate = true
            "#,
        );
        let plan = plan.expect("valid");
        assert_eq!(plan.output, Path::new("out"));
        let [hall, cornell, atrium] = &plan.scenes[..] else { panic!("three") };
        assert_eq!((hall.settings.receivers, hall.settings.probes, hall.settings.gather_rays), (60_000, Some(50), 200));
        assert_eq!((hall.baked(), hall.quality()), ("out/hall.lprt".into(), "out/hall-quality".into()));
        assert_eq!(hall.cache, ["--cache=kept"]);
        let validation = hall.validation.as_ref().expect("validated");
        assert_eq!(validation.lights, [Path::new("noon.json")]);
        assert_eq!(validation.flags, ["--failure-case", "--max-nrmse=0.2", "--receivers=64", "--sweep=degree=1,2"]);
        assert_eq!(validation.limits, BTreeMap::from([("nrmse".into(), 0.2)]));
        assert_eq!((cornell.baked(), &cornell.validation), ("elsewhere/box.lprt".into(), &None));
        assert_eq!((&cornell.cache[..], cornell.settings.gather_rays), (&["--no-cache".to_owned()][..], 100));
        assert_eq!(atrium.validation.as_ref().expect("validated").limits["nrmse"], 0.1);
    }

    #[test]
    fn mistakes_are_told_with_scene_key_and_the_nearest_key() {
        let scene = "[[scene]]\nscene = \"builtin:cornell\"\n";
        let text = refused(&format!("{scene}recievers = 5"));
        assert_eq!(text, "scene `cornell`: unknown key `recievers`\nhelp: did you mean `receivers`?");
        let text = refused(&format!("[defaults]\nnmae = 'x'\n{scene}"));
        assert!(text.starts_with("[defaults]: unknown key `nmae`"), "{text}");
        let text = refused(&format!("{scene}validate = {{ max_nmrse = 0.1 }}"));
        assert_eq!(text, "scene `cornell`: validate: unknown key `max_nmrse`\nhelp: did you mean `max_nrmse`?");
        let text = refused(&format!("{scene}validate = {{ max_nrmse = -1 }}"));
        assert!(text.starts_with("scene `cornell`: validate: invalid value '-1' for '--max-nrmse"), "{text}");
        let text = refused(&format!("{scene}probes = 'many'"));
        assert!(text.starts_with("scene `cornell`: option `probes`: invalid type"), "{text}");
        let text = refused(&format!("[defaults]\nleaf = 1\n{scene}"));
        assert!(text.starts_with("[defaults]: leaf = 1 is out of range; allowed: 2 to 8192"), "{text}");
        assert!(refused(&format!("[default]\n{scene}")).contains("did you mean `defaults`?"));
        assert!(refused(&format!("{scene}preset = 'fast'")).contains("`preset` is not one of preview, medium"));
        assert!(refused("[[scene]]\nprobes = 5").starts_with("scene 1: which one is not said"));
        assert!(refused("[[scene]]\nname='../x'\nscene='a.glb'").contains("cannot be a file's"));
        assert!(refused("[defaults]\n").starts_with("there is no scene"));
        assert!(refused("[[scene]\n").contains("not valid TOML") && refused("a = = 2").contains("(line 1, column 5)"));
    }

    #[test]
    fn no_two_scenes_write_one_file_and_none_writes_over_an_input() {
        let twice = |more: &str| format!("[[scene]]\nscene = 'a/hall.glb'\n[[scene]]\nscene = 'b/hall.glb'\n{more}");
        assert!(refused(&twice("")).starts_with("scene `hall`: baked/hall.glb is also an output of scene `hall`"));
        assert!(refused(&twice("output = 'x/../baked/.'")).contains("is also an output of scene `hall`"));
        read(&twice("name = 'hall-b'")).expect("two names");
        let text = refused("[[scene]]\nscene = 'baked/a.glb'\nname = 'b'\n[[scene]]\nscene = 'c.glb'\nname = 'a'");
        assert!(text.starts_with("scene `a`: baked/a.glb would be written over an input"), "{text}");
        read("[[scene]]\nscene = 'baked/a.glb'").expect("its own scene is left alone");
        let text = refused("[[scene]]\nscene = 'a.glb'\nname = 'a'\nlights = 'baked/a.log'\nvalidate = true");
        assert!(text.contains("baked/a.log would be written over an input"), "{text}");
    }
}
