//! The second backend, in a process of its own: xatlas ends its process on surfaces it does not like.
//!
//! The child is the running program, started again with [`CHILD_ARGUMENT`] alone; its `main` must then return
//! [`xatlas_child_main`]. The request goes to its standard input and the answer comes from its standard output, both
//! little-endian words:
//!
//! ```text
//! request   magic, texels per metre (f32), number of pieces,
//!           then for each piece: vertices, triangles, positions (3 f32 each), indices (3 u32 each)
//! answer    magic, width, height, then for each triangle three corners (2 f32 each, NaN: left out)
//! ```

#[cfg(feature = "xatlas")]
mod child;
mod words;

use super::{MAX_SIZE, Piece, Progress, UnwrapError, Unwrapped, Unwrapper};
use glam::Vec2;
use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::{Duration, Instant};
use words::{Words, push};

/// The argument that makes a program built on this library the child.
pub const CHILD_ARGUMENT: &str = "__unwrap-xatlas";
/// Longest run of the child.
const TIME_LIMIT: Duration = Duration::from_secs(900);
const REQUEST: u32 = u32::from_le_bytes(*b"lpxq");
const ANSWER: u32 = u32::from_le_bytes(*b"lpxa");

/// xatlas in a child process.
#[derive(Clone, Debug)]
pub struct XatlasChild {
    /// The program to start with [`CHILD_ARGUMENT`].
    pub program: PathBuf,
    /// The child is ended after this.
    pub time_limit: Duration,
}

impl XatlasChild {
    /// The running program as the child.
    ///
    /// # Errors
    /// [`UnwrapError::NotBuilt`] in a build without xatlas, [`UnwrapError::Child`] where the running program cannot be
    /// found.
    pub fn new() -> Result<Self, UnwrapError> {
        if !cfg!(feature = "xatlas") {
            return Err(UnwrapError::NotBuilt);
        }
        let program = std::env::current_exe()
            .map_err(|error| UnwrapError::Child { reason: format!("this program cannot be found: {error}") })?;
        Ok(Self { program, time_limit: TIME_LIMIT })
    }
}

/// What a program started with [`CHILD_ARGUMENT`] does: unwraps the request on its standard input.
pub fn xatlas_child_main() -> ExitCode {
    #[cfg(feature = "xatlas")]
    return child::run();
    #[cfg(not(feature = "xatlas"))]
    {
        eprintln!("{}", UnwrapError::NotBuilt);
        ExitCode::from(5)
    }
}

impl Unwrapper for XatlasChild {
    fn name(&self) -> &'static str {
        "xatlas"
    }

    fn unwrap(&self, pieces: &[Piece], texels_per_m: f32, progress: Progress) -> Result<Unwrapped, UnwrapError> {
        let request = request(pieces, texels_per_m);
        let n_triangles: usize = pieces.iter().map(|piece| piece.triangles.len()).sum();
        let answer = self.exchange(&request, 4 * (4 + 6 * n_triangles), progress)?;
        parse_answer(&answer, pieces).ok_or_else(|| UnwrapError::Child { reason: "its answer makes no sense".into() })
    }
}

impl XatlasChild {
    /// Starts the child, sends the request and reads at most `most_bytes`.
    fn exchange(&self, request: &[u8], most_bytes: usize, progress: Progress) -> Result<Vec<u8>, UnwrapError> {
        let failed = |what: &str, error: std::io::Error| UnwrapError::Child { reason: format!("{what}: {error}") };
        let mut child = Command::new(&self.program)
            .arg(CHILD_ARGUMENT)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| failed("its process cannot be started", error))?;
        let (Some(mut input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(UnwrapError::Child { reason: "its process has no pipes".into() });
        };
        std::thread::scope(|scope| {
            // A child that ends early closes the pipe: its exit says more than the failed write.
            scope.spawn(move || input.write_all(request).is_ok());
            let reader = scope.spawn(move || {
                let mut answer = Vec::new();
                output.take(most_bytes as u64 + 1).read_to_end(&mut answer).map(|_| answer)
            });
            let ended = self.wait(&mut child, progress);
            if ended.is_err() {
                // Ends the pipes, and so the threads; a child that is gone already is as good.
                let _ = child.kill();
                let _ = child.wait();
            }
            ended?;
            match reader.join() {
                Ok(Ok(answer)) => Ok(answer),
                Ok(Err(error)) => Err(failed("its answer cannot be read", error)),
                Err(_) => Err(UnwrapError::Child { reason: "its answer cannot be read".into() }),
            }
        })
    }

    fn wait(&self, child: &mut Child, progress: Progress) -> Result<(), UnwrapError> {
        let start = Instant::now();
        loop {
            match child.try_wait() {
                Ok(Some(status)) if status.success() => return Ok(()),
                Ok(Some(status)) => return Err(UnwrapError::Child { reason: format!("{status}") }),
                Ok(None) => {}
                Err(error) => return Err(UnwrapError::Child { reason: format!("its process is lost: {error}") }),
            }
            if start.elapsed() > self.time_limit {
                let seconds = self.time_limit.as_secs_f64();
                return Err(UnwrapError::Child { reason: format!("ended after {seconds} s") });
            }
            if !progress("cutting charts", 0, 0) {
                return Err(UnwrapError::Cancelled);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

fn request(pieces: &[Piece], texels_per_m: f32) -> Vec<u8> {
    let mut bytes = Vec::new();
    push(&mut bytes, &[REQUEST, texels_per_m.to_bits(), pieces.len() as u32]);
    for piece in pieces {
        push(&mut bytes, &[piece.positions.len() as u32, piece.triangles.len() as u32]);
        for position in &piece.positions {
            push(&mut bytes, &position.map(f32::to_bits));
        }
        for triangle in &piece.triangles {
            push(&mut bytes, triangle);
        }
    }
    bytes
}

/// The request as the child reads it; `None` if it is damaged.
#[cfg_attr(not(feature = "xatlas"), cfg_attr(not(test), expect(dead_code, reason = "read by the child alone")))]
fn parse_request(bytes: &[u8]) -> Option<(Vec<Piece>, f32)> {
    let mut words = Words::new(bytes);
    if words.next()? != REQUEST {
        return None;
    }
    let texels_per_m = f32::from_bits(words.next()?);
    let n_pieces = words.next()? as usize;
    let mut pieces = Vec::new();
    for _ in 0..n_pieces {
        let (n_positions, n_triangles) = (words.next()? as usize, words.next()? as usize);
        let positions = words.triples(n_positions)?.into_iter().map(|triple| triple.map(f32::from_bits)).collect();
        pieces.push(Piece { positions, triangles: words.triples(n_triangles)? });
    }
    words.is_at_end().then_some((pieces, texels_per_m))
}

/// The charts; `None` if the answer is damaged.
fn parse_answer(bytes: &[u8], pieces: &[Piece]) -> Option<Unwrapped> {
    let mut words = Words::new(bytes);
    if words.next()? != ANSWER {
        return None;
    }
    let extent = [words.next()?, words.next()?];
    let limit = Vec2::new(extent[0] as f32, extent[1] as f32);
    let mut corners = Vec::with_capacity(pieces.len());
    for piece in pieces {
        let mut of_piece = Vec::with_capacity(piece.triangles.len());
        for _ in &piece.triangles {
            let mut triangle = [Vec2::ZERO; 3];
            for corner in &mut triangle {
                *corner = Vec2::new(f32::from_bits(words.next()?), f32::from_bits(words.next()?));
            }
            let held = triangle.iter().all(|uv| uv.is_finite());
            if held && triangle.iter().any(|uv| uv.cmplt(Vec2::ZERO).any() || uv.cmpgt(limit).any()) {
                return None;
            }
            of_piece.push(held.then_some(triangle));
        }
        corners.push(of_piece);
    }
    // Far above any map that is accepted later, but small enough to multiply.
    let plausible = extent.iter().all(|&side| side <= 4096 * MAX_SIZE);
    (words.is_at_end() && plausible).then_some(Unwrapped { corners })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pieces() -> Vec<Piece> {
        let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        vec![Piece { positions, triangles: vec![[0, 1, 2], [0, 2, 3]] }, Piece::default()]
    }

    #[test]
    fn a_request_reads_back_and_every_prefix_of_it_is_refused() {
        let bytes = request(&pieces(), 16.0);
        let (read, texels_per_m) = parse_request(&bytes).unwrap();
        assert_eq!((read[0].positions.clone(), texels_per_m), (pieces()[0].positions.clone(), 16.0));
        assert_eq!((read[0].triangles.clone(), read.len()), (pieces()[0].triangles.clone(), 2));
        for length in 0..bytes.len() {
            assert!(parse_request(&bytes[..length]).is_none());
        }
        assert!(parse_request(&[bytes, vec![0; 4]].concat()).is_none());
    }

    #[test]
    fn an_answer_with_coordinates_off_its_map_is_refused() {
        let mut bytes = Vec::new();
        push(&mut bytes, &[ANSWER, 4, 4]);
        for value in [0.0f32, 0.0, 4.0, 0.0, 4.0, 4.0, 0.0, 0.0, 4.0, 4.0, 0.0, 4.0] {
            push(&mut bytes, &[value.to_bits()]);
        }
        assert_eq!(parse_answer(&bytes, &pieces()).unwrap().corners[0].len(), 2);
        let last = bytes.len() - 4;
        bytes[last..].copy_from_slice(&4.1f32.to_le_bytes());
        assert!(parse_answer(&bytes, &pieces()).is_none());
    }

    #[test]
    fn a_child_that_fails_is_an_error() {
        let quiet = |_: &str, _: usize, _: usize| true;
        let unwrap = |program: &str, limit| {
            let child = XatlasChild { program: program.into(), time_limit: limit };
            child.unwrap(&pieces(), 64.0, &quiet)
        };
        let limit = Duration::from_secs(20);
        assert!(matches!(unwrap("/no/such/program", limit), Err(UnwrapError::Child { .. })));
        if cfg!(unix) {
            // One ends with an error, one answers with something else (its own argument).
            assert!(matches!(unwrap("false", limit), Err(UnwrapError::Child { .. })));
            assert!(matches!(unwrap("echo", limit), Err(UnwrapError::Child { .. })));
        }
    }
}
