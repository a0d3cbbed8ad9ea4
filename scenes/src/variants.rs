//! Material variants of a scene: KHR_materials_variants.

use crate::lighting::near_names;
use crate::scene::Scene;

/// A variant that cannot be had. What to do is [`VariantError::help`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum VariantError {
    /// There is none of that name.
    #[error("the scene has no material variant {name:?}")]
    Unknown {
        /// The name that was given.
        name: String,
        /// Names that are there, the nearest first.
        near: String,
    },
    /// A mesh would let light pass where it did not, or the other way.
    #[error(
        "in the variant {name:?} mesh {mesh:?} has material {to:?}, whose alpha mode or sides are not those of {from:?}"
    )]
    Geometry {
        /// The variant.
        name: String,
        /// The mesh.
        mesh: String,
        /// Its material by default.
        from: String,
        /// Its material in the variant.
        to: String,
    },
}

impl VariantError {
    /// What to do.
    pub fn help(&self) -> String {
        match self {
            Self::Unknown { near, .. } if near.is_empty() => "leave it out: the scene has no variants".into(),
            Self::Unknown { near, .. } => format!("choose one of the scene's, such as {near}"),
            Self::Geometry { .. } => {
                "relight another variant, or export the scene with this one's materials and bake that: holes are part of the bake".into()
            }
        }
    }
}

impl Scene {
    /// Gives every mesh the material that it has in a variant; those that the variant does not name keep theirs.
    ///
    /// # Errors
    /// [`VariantError`], and nothing has changed.
    pub fn apply_variant(&mut self, name: &str) -> Result<(), VariantError> {
        let Some(number) = self.variants.iter().position(|variant| variant == name) else {
            let known = self.variants.iter().map(String::as_str).collect();
            return Err(VariantError::Unknown { name: name.into(), near: near_names(name, &known) });
        };
        let of_mesh = |mesh: &crate::scene::Mesh| {
            mesh.variants.iter().find(|[variant, _]| *variant == number).map(|pair| pair[1])
        };
        for mesh in &self.meshes {
            let Some(material) = of_mesh(mesh) else { continue };
            let [from, to] = [mesh.material, material].map(|material| &self.materials[material]);
            if (from.alpha, from.double_sided) != (to.alpha, to.double_sided) {
                return Err(VariantError::Geometry {
                    name: name.into(),
                    mesh: mesh.name.clone(),
                    from: from.name.clone(),
                    to: to.name.clone(),
                });
            }
        }
        for mesh in &mut self.meshes {
            mesh.material = of_mesh(mesh).unwrap_or(mesh.material);
        }
        Ok(())
    }

    /// Leaves out what light passes through for the most part, so that it passes whole, and says how many triangles that were. Materials
    /// stay.
    pub fn leave_out_clear(&mut self) -> usize {
        let before = self.face_count();
        self.meshes.retain(|mesh| self.materials[mesh.material].transmission < 0.5);
        before - self.face_count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin;
    use crate::scene::AlphaMode;

    fn varied() -> Scene {
        let mut scene = builtin::scene("cornell").expect("a scene");
        scene.variants = vec!["summer".into(), "winter".into()];
        let [red, green] = ["red", "green"].map(|name| {
            scene.materials.iter().position(|material| material.name == name).expect("a material of this name")
        });
        for mesh in scene.meshes.iter_mut().filter(|mesh| mesh.material == red) {
            mesh.variants = vec![[1, green]];
        }
        scene
    }

    fn materials(scene: &Scene) -> Vec<usize> {
        scene.meshes.iter().map(|mesh| mesh.material).collect()
    }

    #[test]
    fn a_variant_changes_what_it_names_alone() {
        let scene = varied();
        let mut summer = scene.clone();
        assert_eq!(summer.apply_variant("summer"), Ok(()));
        assert_eq!(materials(&summer), materials(&scene));
        let mut winter = scene.clone();
        assert_eq!(winter.apply_variant("winter"), Ok(()));
        let changed = scene.meshes.iter().zip(&winter.meshes).filter(|(old, new)| old.material != new.material);
        assert!(changed.count() == scene.meshes.iter().filter(|mesh| !mesh.variants.is_empty()).count());
        let error = winter.apply_variant("wintre").unwrap_err();
        assert!(error.help().contains("\"winter\", \"summer\""), "{}", error.help());
    }

    #[test]
    fn a_variant_with_other_holes_is_refused_and_changes_nothing() {
        let mut scene = varied();
        let before = materials(&scene);
        let green = scene.materials.iter().position(|material| material.name == "green").expect("green");
        scene.materials[green].alpha = AlphaMode::Mask { cutoff: 0.5 };
        assert!(matches!(scene.apply_variant("winter"), Err(VariantError::Geometry { .. })));
        assert_eq!(materials(&scene), before);
    }

    #[test]
    fn what_light_passes_through_is_left_out() {
        let mut scene = varied();
        let all = scene.face_count();
        assert_eq!(scene.leave_out_clear(), 0);
        let red = scene.materials.iter().position(|material| material.name == "red").expect("red");
        scene.materials[red].transmission = 0.9;
        let clear = scene.leave_out_clear();
        assert!(clear > 0 && scene.face_count() == all - clear);
    }
}
