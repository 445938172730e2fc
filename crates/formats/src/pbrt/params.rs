//! Typed parameter lists, with lookups that record the use of parameters.
//!
//! After processing a directive, [`ParamSet::report_unused`] reports every parameter without lookup: a misspelled
//! parameter is an error, never silently a default.

use crate::color_space::ColorSpace;
use crate::diagnostic::{Diagnostics, similar_parameter};
use crate::source::Span;
use lumiris_numbers::math::DVec3;
use std::cell::{Cell, RefCell};

/// The type that a parameter declares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the variants are pbrt's types")]
pub enum ParamType {
    Integer,
    Float,
    Point2,
    Vector2,
    Point3,
    Vector3,
    Normal,
    Spectrum,
    Rgb,
    Xyz,
    Blackbody,
    Texture,
    String,
    Bool,
}

impl ParamType {
    /// The type of a declaration, in the spelling of pbrt-v4 or pbrt-v3.
    pub fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "integer" => ParamType::Integer,
            "float" => ParamType::Float,
            "point2" => ParamType::Point2,
            "vector2" => ParamType::Vector2,
            "point3" | "point" => ParamType::Point3,
            "vector3" | "vector" => ParamType::Vector3,
            "normal" | "normal3" => ParamType::Normal,
            "spectrum" => ParamType::Spectrum,
            "rgb" | "color" => ParamType::Rgb,
            "blackbody" => ParamType::Blackbody,
            "texture" => ParamType::Texture,
            "string" => ParamType::String,
            "bool" => ParamType::Bool,
            "xyz" => ParamType::Xyz,
            _ => return None,
        })
    }

    /// True for spellings of types that pbrt-v4 does not have.
    pub fn is_v3_name(name: &str) -> bool {
        matches!(name, "point" | "vector" | "color" | "xyz")
    }

    /// The spelling of pbrt-v4.
    pub fn name(self) -> &'static str {
        match self {
            ParamType::Integer => "integer",
            ParamType::Float => "float",
            ParamType::Point2 => "point2",
            ParamType::Vector2 => "vector2",
            ParamType::Point3 => "point3",
            ParamType::Vector3 => "vector3",
            ParamType::Normal => "normal",
            ParamType::Spectrum => "spectrum",
            ParamType::Rgb => "rgb",
            ParamType::Xyz => "xyz",
            ParamType::Blackbody => "blackbody",
            ParamType::Texture => "texture",
            ParamType::String => "string",
            ParamType::Bool => "bool",
        }
    }

    /// Number of scalars per value.
    pub fn arity(self) -> usize {
        match self {
            ParamType::Point2 | ParamType::Vector2 => 2,
            ParamType::Point3 | ParamType::Vector3 | ParamType::Normal | ParamType::Rgb | ParamType::Xyz => 3,
            ParamType::Integer
            | ParamType::Float
            | ParamType::Spectrum
            | ParamType::Blackbody
            | ParamType::Texture
            | ParamType::String
            | ParamType::Bool => 1,
        }
    }

    /// All spellings of pbrt-v4, for suggestions.
    pub const NAMES: &[&str] = &[
        "integer",
        "float",
        "point2",
        "vector2",
        "point3",
        "vector3",
        "normal",
        "spectrum",
        "rgb",
        "blackbody",
        "texture",
        "string",
        "bool",
    ];
}

/// The values of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Numbers of all types except `integer` and `point3`.
    Floats(Vec<f32>),
    /// Numbers of `point3`: distances between points may be small relative to their coordinates.
    Doubles(Vec<f64>),
    /// `integer`.
    Integers(Vec<i32>),
    /// `bool`.
    Bools(Vec<bool>),
    /// `string`, `texture`, and `spectrum` by name.
    Strings(Vec<String>),
}

impl Values {
    /// Number of scalars.
    pub fn len(&self) -> usize {
        match self {
            Values::Floats(v) => v.len(),
            Values::Doubles(v) => v.len(),
            Values::Integers(v) => v.len(),
            Values::Bools(v) => v.len(),
            Values::Strings(v) => v.len(),
        }
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The text of a single scalar.
    pub fn only(&self) -> Option<String> {
        fn text<T: ToString>(values: &[T]) -> Option<String> {
            if let [value] = values { Some(value.to_string()) } else { None }
        }
        match self {
            Values::Floats(v) => text(v),
            Values::Doubles(v) => text(v),
            Values::Integers(v) => text(v),
            Values::Bools(v) => text(v),
            Values::Strings(v) => text(v),
        }
    }
}

/// One parameter.
#[derive(Clone, Debug)]
pub struct Param {
    /// Declared type.
    pub ty: ParamType,
    /// Name.
    pub name: String,
    /// The quoted declaration.
    pub span: Span,
    /// The values, with brackets.
    pub value_span: Span,
    /// The values; whole values of the type.
    pub values: Values,
    /// Colour space of an `rgb`, if it differs from the current one of the directive that uses it.
    pub color_space: Option<ColorSpace>,
    used: Cell<bool>,
    inherited: bool,
}

impl Param {
    /// An unused parameter.
    pub fn new(ty: ParamType, name: String, span: Span, value_span: Span, values: Values) -> Self {
        Param { ty, name, span, value_span, values, color_space: None, used: Cell::new(false), inherited: false }
    }
}

/// A spectrum as written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpectrumValue<'a> {
    /// Red, green, blue in a colour space: the parameter's own, or the current one.
    Rgb([f32; 3], Option<ColorSpace>),
    /// CIE XYZ (pbrt-v3).
    Xyz([f32; 3]),
    /// Temperature (K) and a factor (pbrt-v3; 1 in v4).
    Blackbody(f32, f32),
    /// A known name or a file.
    Named(&'a str),
    /// Pairs of wavelength (nm) and value.
    Samples(&'a [f32]),
}

/// A value or the name of a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input<'a, T> {
    /// A constant value.
    Value(T),
    /// Name of a texture.
    Texture(&'a str),
}

/// The parameters of one directive.
#[derive(Clone, Debug)]
pub struct ParamSet {
    /// The directive, for messages: `Shape "sphere"`.
    pub owner: String,
    /// The keyword of the directive.
    pub span: Span,
    params: Vec<Param>,
    asked: RefCell<Vec<&'static str>>,
}

impl ParamSet {
    /// No parameters.
    pub fn new(owner: impl Into<String>, span: Span) -> Self {
        ParamSet { owner: owner.into(), span, params: Vec::new(), asked: RefCell::default() }
    }

    /// Adds a parameter; a second one of the same name is an error.
    pub fn push(&mut self, param: Param, diagnostics: &mut Diagnostics) {
        if let Some(first) = self.params.iter().find(|p| p.name == param.name && !p.inherited) {
            let message = format!("parameter `{}` is given twice", param.name);
            diagnostics.error(param.span, message).remark("again").label(first.span, "first given here");
            return;
        }
        self.params.push(param);
    }

    /// Adds parameters of `Attribute` as defaults: the directive's own parameters take precedence, and defaults may be
    /// unused.
    pub fn inherit<'a>(&mut self, defaults: impl IntoIterator<Item = &'a Param>) {
        for default in defaults {
            self.params.retain(|p| !(p.inherited && p.name == default.name));
            if !self.params.iter().any(|p| p.name == default.name) {
                self.params.push(Param { inherited: true, used: Cell::new(false), ..default.clone() });
            }
        }
    }

    /// All parameters, with the current colour space recorded, for use in a directive elsewhere.
    pub fn in_color_space(&self, space: ColorSpace) -> impl Iterator<Item = Param> {
        self.params.iter().map(move |p| Param { color_space: Some(space), ..p.clone() })
    }

    /// All parameters.
    pub fn iter(&self) -> impl Iterator<Item = &Param> {
        self.params.iter()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.params.is_empty()
    }

    /// The declared type of a parameter, without marking it as used.
    pub fn type_of(&self, name: &str) -> Option<ParamType> {
        self.params.iter().find(|p| p.name == name).map(|p| p.ty)
    }

    /// Source position of a parameter's declaration, or of the directive if it is absent.
    pub fn span_of(&self, name: &str) -> Span {
        self.params.iter().find(|p| p.name == name).map_or(self.span, |p| p.span.to(p.value_span))
    }

    /// Marks a parameter of any type as used; returns true if it is present.
    pub fn ignore(&self, name: &'static str) -> bool {
        self.note(name);
        let found = self.params.iter().find(|p| p.name == name);
        found.inspect(|p| p.used.set(true)).is_some()
    }

    /// Marks all parameters as used.
    pub fn ignore_all(&self) {
        self.params.iter().for_each(|p| p.used.set(true));
    }

    /// The parameter, if it is present with one of the types; another type is an error.
    pub fn get(&self, name: &'static str, types: &[ParamType], diagnostics: &mut Diagnostics) -> Option<&Param> {
        self.note(name);
        let param = self.params.iter().find(|p| p.name == name)?;
        let first_time = !param.used.replace(true);
        if types.contains(&param.ty) {
            return Some(param);
        }
        if first_time {
            let expected: Vec<String> = types.iter().map(|t| format!("`{} {name}`", t.name())).collect();
            let message = format!("`{}` has the wrong type for {}", param.name, self.owner);
            let remark = format!("is `{}`", param.ty.name());
            diagnostics.error(param.span, message).remark(remark).help(format!("write {}", expected.join(" or ")));
        }
        None
    }

    /// As [`ParamSet::get`]; there must be exactly one value.
    pub fn get_one(&self, name: &'static str, types: &[ParamType], diagnostics: &mut Diagnostics) -> Option<&Param> {
        let param = self.get(name, types, diagnostics)?;
        let count = param.values.len() / param.ty.arity();
        if count == 1 {
            return Some(param);
        }
        diagnostics.error(param.value_span, format!("`{name}` takes one value, not {count}"));
        None
    }

    /// One float.
    pub fn float(&self, name: &'static str, diagnostics: &mut Diagnostics) -> Option<f32> {
        self.get_one(name, &[ParamType::Float], diagnostics).and_then(|p| p.first_float())
    }

    /// One integer.
    pub fn integer(&self, name: &'static str, diagnostics: &mut Diagnostics) -> Option<i32> {
        match &self.get_one(name, &[ParamType::Integer], diagnostics)?.values {
            Values::Integers(v) => v.first().copied(),
            Values::Floats(_) | Values::Doubles(_) | Values::Bools(_) | Values::Strings(_) => None,
        }
    }

    /// One Boolean.
    pub fn boolean(&self, name: &'static str, diagnostics: &mut Diagnostics) -> Option<bool> {
        match &self.get_one(name, &[ParamType::Bool], diagnostics)?.values {
            Values::Bools(v) => v.first().copied(),
            Values::Floats(_) | Values::Doubles(_) | Values::Integers(_) | Values::Strings(_) => None,
        }
    }

    /// One string.
    pub fn string(&self, name: &'static str, diagnostics: &mut Diagnostics) -> Option<&str> {
        self.get_one(name, &[ParamType::String], diagnostics).and_then(|p| p.first_string())
    }

    /// All strings.
    pub fn strings(&self, name: &'static str, diagnostics: &mut Diagnostics) -> Option<&[String]> {
        match &self.get(name, &[ParamType::String], diagnostics)?.values {
            Values::Strings(v) => Some(v),
            Values::Floats(_) | Values::Doubles(_) | Values::Integers(_) | Values::Bools(_) => None,
        }
    }

    /// One point.
    pub fn point(&self, name: &'static str, diagnostics: &mut Diagnostics) -> Option<DVec3> {
        let point: [f64; 3] = self.get_one(name, &[ParamType::Point3], diagnostics)?.doubles()?.try_into().ok()?;
        Some(DVec3::from_array(point))
    }

    /// The points of an array.
    pub fn points(
        &self,
        name: &'static str,
        diagnostics: &mut Diagnostics,
    ) -> Option<impl ExactSizeIterator<Item = DVec3> + Clone> {
        Some(self.get(name, &[ParamType::Point3], diagnostics)?.doubles()?.chunks_exact(3).map(DVec3::from_slice))
    }

    /// One triple of a three-dimensional type other than `point3`.
    pub fn triple(&self, name: &'static str, ty: ParamType, diagnostics: &mut Diagnostics) -> Option<[f32; 3]> {
        self.get_one(name, &[ty], diagnostics).and_then(|p| p.floats()?.try_into().ok())
    }

    /// All floats of a `float` array.
    pub fn floats(&self, name: &'static str, diagnostics: &mut Diagnostics) -> Option<&[f32]> {
        self.get(name, &[ParamType::Float], diagnostics).and_then(|p| p.floats())
    }

    /// Moves the numbers of an array out of the set.
    pub fn take_floats(
        &mut self,
        name: &'static str,
        types: &[ParamType],
        diagnostics: &mut Diagnostics,
    ) -> Option<Vec<f32>> {
        self.get(name, types, diagnostics)?;
        match &mut self.params.iter_mut().find(|p| p.name == name)?.values {
            Values::Floats(v) => Some(std::mem::take(v)),
            Values::Doubles(_) | Values::Integers(_) | Values::Bools(_) | Values::Strings(_) => None,
        }
    }

    /// Moves the numbers of an `integer` array out of the set.
    pub fn take_integers(&mut self, name: &'static str, diagnostics: &mut Diagnostics) -> Option<Vec<i32>> {
        self.get(name, &[ParamType::Integer], diagnostics)?;
        match &mut self.params.iter_mut().find(|p| p.name == name)?.values {
            Values::Integers(v) => Some(std::mem::take(v)),
            Values::Floats(_) | Values::Doubles(_) | Values::Bools(_) | Values::Strings(_) => None,
        }
    }

    /// A spectrum.
    pub fn spectrum(&self, name: &'static str, diagnostics: &mut Diagnostics) -> Option<SpectrumValue<'_>> {
        let param = self.get(name, SPECTRUM_TYPES, diagnostics)?;
        param.spectrum(diagnostics)
    }

    /// A float or a texture of floats.
    pub fn float_input(&self, name: &'static str, diagnostics: &mut Diagnostics) -> Option<Input<'_, f32>> {
        let param = self.get_one(name, &[ParamType::Float, ParamType::Texture], diagnostics)?;
        match &param.values {
            Values::Strings(v) => v.first().map(|t| Input::Texture(t)),
            Values::Floats(v) => v.first().map(|&x| Input::Value(x)),
            Values::Doubles(_) | Values::Integers(_) | Values::Bools(_) => None,
        }
    }

    /// A spectrum or a texture of spectra.
    pub fn spectrum_input(
        &self,
        name: &'static str,
        diagnostics: &mut Diagnostics,
    ) -> Option<Input<'_, SpectrumValue<'_>>> {
        let param = self.get(name, SPECTRUM_OR_TEXTURE, diagnostics)?;
        if param.ty == ParamType::Texture {
            return self.get_one(name, &[ParamType::Texture], diagnostics)?.first_string().map(Input::Texture);
        }
        param.spectrum(diagnostics).map(Input::Value)
    }

    /// Reports an error for each unused parameter.
    pub fn report_unused(&self, diagnostics: &mut Diagnostics) {
        for param in self.params.iter().filter(|p| !p.used.get() && !p.inherited) {
            let asked = self.asked.borrow();
            let message = format!("{} has no parameter `{}`", self.owner, param.name);
            let known = || asked.iter().copied().filter(|&n| n != param.name);
            let help = match similar_parameter(&param.name, known()) {
                Some(near) => format!("did you mean `{near}`?"),
                None if asked.is_empty() => "it takes no parameters".to_owned(),
                None => format!("its parameters are {}", known().collect::<Vec<_>>().join(", ")),
            };
            diagnostics.error(param.span, message).help(help);
        }
    }

    fn note(&self, name: &'static str) {
        let mut asked = self.asked.borrow_mut();
        if !asked.contains(&name) {
            asked.push(name);
        }
    }
}

const SPECTRUM_TYPES: &[ParamType] = &[ParamType::Rgb, ParamType::Spectrum, ParamType::Blackbody, ParamType::Xyz];
const SPECTRUM_OR_TEXTURE: &[ParamType] =
    &[ParamType::Rgb, ParamType::Spectrum, ParamType::Texture, ParamType::Blackbody, ParamType::Xyz];

impl Param {
    /// The numbers of points.
    pub fn doubles(&self) -> Option<&[f64]> {
        match &self.values {
            Values::Doubles(v) => Some(v),
            Values::Floats(_) | Values::Integers(_) | Values::Bools(_) | Values::Strings(_) => None,
        }
    }

    /// The numbers, except for integers and points.
    pub fn floats(&self) -> Option<&[f32]> {
        match &self.values {
            Values::Floats(v) => Some(v),
            Values::Doubles(_) | Values::Integers(_) | Values::Bools(_) | Values::Strings(_) => None,
        }
    }

    fn first_float(&self) -> Option<f32> {
        self.floats()?.first().copied()
    }

    fn first_string(&self) -> Option<&str> {
        match &self.values {
            Values::Strings(v) => v.first().map(String::as_str),
            Values::Floats(_) | Values::Doubles(_) | Values::Integers(_) | Values::Bools(_) => None,
        }
    }

    fn spectrum(&self, diagnostics: &mut Diagnostics) -> Option<SpectrumValue<'_>> {
        let value = match (&self.values, self.ty) {
            (Values::Floats(v), ParamType::Rgb) => {
                v.as_slice().try_into().ok().map(|rgb| SpectrumValue::Rgb(rgb, self.color_space))
            }
            (Values::Floats(v), ParamType::Xyz) => v.as_slice().try_into().ok().map(SpectrumValue::Xyz),
            (Values::Floats(v), ParamType::Blackbody) => match v.as_slice() {
                [kelvin] => Some(SpectrumValue::Blackbody(*kelvin, 1.0)),
                [kelvin, factor] => {
                    let message = "a blackbody with a factor is pbrt-v3; one of pbrt-v4 is a temperature, and lights have a `scale`";
                    diagnostics.warning_first(self.value_span, message);
                    Some(SpectrumValue::Blackbody(*kelvin, *factor))
                }
                _ => None,
            },
            (Values::Floats(v), _) if !v.is_empty() && v.len() % 2 == 0 => Some(SpectrumValue::Samples(v)),
            (Values::Strings(v), _) if v.len() == 1 => Some(SpectrumValue::Named(&v[0])),
            _ => None,
        };
        if value.is_none() {
            let form = match self.ty {
                ParamType::Rgb | ParamType::Xyz => "three numbers",
                ParamType::Blackbody => "one temperature",
                _ => "one name or pairs of wavelength and value",
            };
            let count = self.values.len();
            diagnostics.error(self.value_span, format!("`{}` takes {form}, not {count} values", self.name));
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::SourceMap;

    fn param(ty: ParamType, name: &str, values: Values) -> Param {
        Param::new(ty, name.to_owned(), Span::default(), Span::default(), values)
    }

    fn messages(diagnostics: Diagnostics) -> Vec<String> {
        diagnostics.finish(&SourceMap::new()).entries.into_iter().map(|e| e.message).collect()
    }

    #[test]
    fn own_parameters_win_over_inherited_ones_and_only_own_ones_must_be_used() {
        let mut diagnostics = Diagnostics::new();
        let mut set = ParamSet::new("Shape \"disk\"", Span::default());
        set.push(param(ParamType::Float, "radius", Values::Floats(vec![2.0])), &mut diagnostics);
        set.inherit(&[
            param(ParamType::Float, "radius", Values::Floats(vec![3.0])),
            param(ParamType::Float, "alpha", Values::Floats(vec![0.5])),
        ]);
        assert_eq!(set.float("radius", &mut diagnostics), Some(2.0));
        set.report_unused(&mut diagnostics);
        assert!(diagnostics.is_empty());
        assert_eq!(set.float("alpha", &mut diagnostics), Some(0.5));
    }

    #[test]
    fn wrong_types_counts_and_doubles_are_errors() {
        let mut diagnostics = Diagnostics::new();
        let mut set = ParamSet::new("Camera \"perspective\"", Span::default());
        set.push(param(ParamType::Integer, "fov", Values::Integers(vec![45])), &mut diagnostics);
        set.push(param(ParamType::Float, "fov", Values::Floats(vec![45.0])), &mut diagnostics);
        set.push(param(ParamType::Rgb, "l", Values::Floats(vec![1.0; 6])), &mut diagnostics);
        assert_eq!(set.float("fov", &mut diagnostics), None);
        assert_eq!(set.float("fov", &mut diagnostics), None);
        assert_eq!(set.spectrum("l", &mut diagnostics), None);
        let found = messages(diagnostics);
        assert_eq!(found.len(), 3, "{found:?}");
        assert!(found[0].contains("twice") && found[1].contains("wrong type") && found[2].contains("three numbers"));
    }
}
