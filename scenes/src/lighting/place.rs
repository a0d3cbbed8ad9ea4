//! JSON values that know where they stand, so that every message can name its place.

use super::LightingError;
use glam::Vec3;
use serde_json::{Map, Value};

/// A value and where it stands.
pub(super) struct Place<'a> {
    pub(super) pointer: String,
    pub(super) value: &'a Value,
}

/// An object whose keys are all known.
pub(super) struct Object<'a> {
    pub(super) pointer: String,
    pub(super) entries: &'a Map<String, Value>,
}

impl<'a> Place<'a> {
    pub(super) fn child(&self, key: &str) -> String {
        // Escapes of RFC 6901.
        format!("{}/{}", self.pointer, key.replace('~', "~0").replace('/', "~1"))
    }

    pub(super) fn shown(&self) -> String {
        if self.pointer.is_empty() { "top level".into() } else { self.pointer.clone() }
    }

    pub(super) fn object(&self, known: &[&'static str]) -> Result<Object<'a>, LightingError> {
        let Value::Object(entries) = self.value else {
            return Err(self.wrong_type("an object"));
        };
        if let Some(key) = entries.keys().find(|key| !known.contains(&key.as_str())) {
            let nearest = known.iter().min_by_key(|candidate| strsim::levenshtein(key, candidate));
            return Err(LightingError::UnknownKey {
                place: self.shown(),
                key: key.clone(),
                nearest: nearest.copied().unwrap_or(""),
                known: known.join(", "),
            });
        }
        Ok(Object { pointer: self.pointer.clone(), entries })
    }

    pub(super) fn items(&self) -> Result<Vec<Place<'a>>, LightingError> {
        let Value::Array(items) = self.value else {
            return Err(self.wrong_type("an array"));
        };
        let place = |(index, value)| Place { pointer: format!("{}/{index}", self.pointer), value };
        Ok(items.iter().enumerate().map(place).collect())
    }

    pub(super) fn text(&self) -> Result<&'a str, LightingError> {
        self.value.as_str().ok_or_else(|| self.wrong_type("a string"))
    }

    /// Finite as f32.
    pub(super) fn number(&self) -> Result<f32, LightingError> {
        let number = self.value.as_f64().ok_or_else(|| self.wrong_type("a number"))? as f32;
        if number.is_finite() { Ok(number) } else { Err(self.out_of_range("within the range of 32-bit floats")) }
    }

    pub(super) fn number_within(
        &self,
        allowed: &'static str,
        is_allowed: impl Fn(f32) -> bool,
    ) -> Result<f32, LightingError> {
        let number = self.number()?;
        if is_allowed(number) { Ok(number) } else { Err(self.out_of_range(allowed)) }
    }

    pub(super) fn vector(&self) -> Result<Vec3, LightingError> {
        match self.value {
            Value::Array(items) if items.len() == 3 => {
                let items = self.items()?;
                Ok(Vec3::new(items[0].number()?, items[1].number()?, items[2].number()?))
            }
            _ => Err(self.wrong_type("an array of three numbers")),
        }
    }

    /// Three numbers of at least 0.
    pub(super) fn radiance(&self) -> Result<Vec3, LightingError> {
        let radiance = self.vector()?;
        if radiance.min_element() >= 0.0 { Ok(radiance) } else { Err(self.out_of_range("at least 0 in every band")) }
    }

    pub(super) fn wrong_type(&self, expected: &'static str) -> LightingError {
        let found = match self.value {
            Value::Null => "null".into(),
            Value::Bool(value) => value.to_string(),
            Value::Number(number) => number.to_string(),
            Value::String(_) => "a string".into(),
            Value::Array(items) => format!("an array of {}", items.len()),
            Value::Object(_) => "an object".into(),
        };
        LightingError::WrongType { place: self.shown(), expected, found }
    }

    pub(super) fn out_of_range(&self, allowed: &'static str) -> LightingError {
        LightingError::OutOfRange { place: self.shown(), allowed, found: self.value.to_string() }
    }

    pub(super) fn unknown_choice(&self, allowed: &'static str, found: &str) -> LightingError {
        LightingError::UnknownChoice { place: self.shown(), allowed, found: found.into() }
    }
}

impl<'a> Object<'a> {
    pub(super) fn get(&self, key: &'static str) -> Option<Place<'a>> {
        self.entries.get(key).map(|value| Place { pointer: format!("{}/{key}", self.pointer), value })
    }

    pub(super) fn require(&self, key: &'static str, reason: &'static str) -> Result<Place<'a>, LightingError> {
        self.get(key).ok_or_else(|| LightingError::MissingKey { place: self.pointer.clone(), key, reason })
    }

    pub(super) fn number_or(
        &self,
        key: &'static str,
        default: f32,
        allowed: &'static str,
        is_allowed: impl Fn(f32) -> bool,
    ) -> Result<f32, LightingError> {
        self.get(key).map_or(Ok(default), |place| place.number_within(allowed, is_allowed))
    }
}
