//! Validation of the JSON members that the renderer reads: a table of paths with types, and a traversal that checks
//! them.
//!
//! A path consists of member names, with `[]` for every element of an array, `*` for every member of an object, and `@`
//! for every reference to a texture. Absent values are not errors here.

use super::place::{GltfError, Place};
use std::sync::LazyLock;

/// Maximum number of reported errors per file.
const MAX_ERRORS: usize = 20;

/// The required type of a value.
#[derive(Clone, Copy, Debug)]
enum Rule {
    /// Index into an array of the document.
    Index(&'static str),
    /// Index into the lights.
    Light,
    /// An array of this many finite numbers.
    Numbers(usize),
    /// A finite number.
    Number,
    /// A non-negative integer.
    Whole,
    /// One of these integers.
    OneOf(&'static [usize]),
    /// Text.
    Text,
    /// One of these words.
    Word(&'static [&'static str]),
    /// A finite number above 0.
    Positive,
    /// A finite non-negative number.
    NotNegative,
    /// A Boolean.
    Flag,
    /// An array.
    Array,
    /// An object.
    Object,
}

use Rule::{Array, Flag, Index, Light, NotNegative, Number, Numbers, Object, OneOf, Positive, Text, Whole, Word};

const COMPONENTS: Rule = OneOf(&[5120, 5121, 5122, 5123, 5125, 5126]);

const RULES: &[(&str, Rule)] = &[
    ("extensionsUsed", Array),
    ("extensionsUsed[]", Text),
    ("scene", Index("scenes")),
    ("scenes", Array),
    ("scenes[].nodes", Array),
    ("scenes[].nodes[]", Index("nodes")),
    ("nodes", Array),
    ("nodes[]", Object),
    ("nodes[].children", Array),
    ("nodes[].children[]", Index("nodes")),
    ("nodes[].mesh", Index("meshes")),
    ("nodes[].camera", Index("cameras")),
    ("nodes[].skin", Index("skins")),
    ("nodes[].matrix", Numbers(16)),
    ("nodes[].translation", Numbers(3)),
    ("nodes[].rotation", Numbers(4)),
    ("nodes[].scale", Numbers(3)),
    ("nodes[].weights", Array),
    ("nodes[].weights[]", Number),
    ("nodes[].extensions.KHR_lights_punctual.light", Light),
    ("nodes[].extensions.KHR_node_visibility.visible", Flag),
    ("nodes[].extensions.EXT_mesh_gpu_instancing.attributes.*", Index("accessors")),
    ("meshes", Array),
    ("meshes[].primitives", Array),
    ("meshes[].weights", Array),
    ("meshes[].weights[]", Number),
    ("meshes[].primitives[].attributes", Object),
    ("meshes[].primitives[].attributes.*", Index("accessors")),
    ("meshes[].primitives[].indices", Index("accessors")),
    ("meshes[].primitives[].material", Index("materials")),
    ("meshes[].primitives[].mode", OneOf(&[0, 1, 2, 3, 4, 5, 6])),
    ("meshes[].primitives[].targets", Array),
    ("meshes[].primitives[].targets[]", Object),
    ("meshes[].primitives[].targets[].*", Index("accessors")),
    ("skins", Array),
    ("skins[].joints", Array),
    ("skins[].joints[]", Index("nodes")),
    ("skins[].inverseBindMatrices", Index("accessors")),
    ("cameras", Array),
    ("cameras[].type", Word(&["perspective", "orthographic"])),
    ("cameras[].perspective.yfov", Positive),
    ("cameras[].perspective.aspectRatio", Number),
    ("cameras[].orthographic.xmag", Number),
    ("cameras[].orthographic.ymag", Number),
    ("extensions.KHR_lights_punctual.lights", Array),
    ("extensions.KHR_lights_punctual.lights[].type", Word(&["directional", "point", "spot"])),
    ("extensions.KHR_lights_punctual.lights[].color", Numbers(3)),
    ("extensions.KHR_lights_punctual.lights[].intensity", NotNegative),
    ("extensions.KHR_lights_punctual.lights[].spot.innerConeAngle", Number),
    ("extensions.KHR_lights_punctual.lights[].spot.outerConeAngle", Number),
    ("accessors", Array),
    ("accessors[].bufferView", Index("bufferViews")),
    ("accessors[].byteOffset", Whole),
    ("accessors[].componentType", COMPONENTS),
    ("accessors[].count", Whole),
    ("accessors[].type", Text),
    ("accessors[].normalized", Flag),
    ("accessors[].sparse.count", Whole),
    ("accessors[].sparse.indices.bufferView", Index("bufferViews")),
    ("accessors[].sparse.indices.byteOffset", Whole),
    ("accessors[].sparse.indices.componentType", OneOf(&[5121, 5123, 5125])),
    ("accessors[].sparse.values.bufferView", Index("bufferViews")),
    ("accessors[].sparse.values.byteOffset", Whole),
    ("bufferViews", Array),
    ("bufferViews[].buffer", Index("buffers")),
    ("bufferViews[].byteOffset", Whole),
    ("bufferViews[].byteLength", Whole),
    ("bufferViews[].byteStride", Whole),
    ("buffers", Array),
    ("buffers[].byteLength", Whole),
    ("buffers[].uri", Text),
    ("images", Array),
    ("images[].bufferView", Index("bufferViews")),
    ("images[].uri", Text),
    ("textures", Array),
    ("textures[].source", Index("images")),
    ("textures[].sampler", Index("samplers")),
    ("samplers", Array),
    ("samplers[].magFilter", Whole),
    ("samplers[].wrapS", OneOf(&[33071, 33648, 10497])),
    ("samplers[].wrapT", OneOf(&[33071, 33648, 10497])),
    ("materials", Array),
    ("materials[]", Object),
    ("materials[].alphaMode", Word(&["OPAQUE", "MASK", "BLEND"])),
    ("materials[].alphaCutoff", Number),
    ("materials[].doubleSided", Flag),
    ("materials[].emissiveFactor", Numbers(3)),
    ("materials[].normalTexture.scale", Number),
    ("materials[].pbrMetallicRoughness.baseColorFactor", Numbers(4)),
    ("materials[].pbrMetallicRoughness.metallicFactor", Number),
    ("materials[].pbrMetallicRoughness.roughnessFactor", Number),
    ("materials[].extensions.KHR_materials_anisotropy.anisotropyStrength", Number),
    ("materials[].extensions.KHR_materials_anisotropy.anisotropyRotation", Number),
    ("materials[].extensions.KHR_materials_clearcoat.clearcoatFactor", Number),
    ("materials[].extensions.KHR_materials_clearcoat.clearcoatRoughnessFactor", Number),
    ("materials[].extensions.KHR_materials_dispersion.dispersion", Number),
    ("materials[].extensions.KHR_materials_emissive_strength.emissiveStrength", Number),
    ("materials[].extensions.KHR_materials_ior.ior", Number),
    ("materials[].extensions.KHR_materials_pbrSpecularGlossiness.diffuseFactor", Numbers(4)),
    ("materials[].extensions.KHR_materials_pbrSpecularGlossiness.specularFactor", Numbers(3)),
    ("materials[].extensions.KHR_materials_pbrSpecularGlossiness.glossinessFactor", Number),
    ("materials[].extensions.KHR_materials_sheen.sheenColorFactor", Numbers(3)),
    ("materials[].extensions.KHR_materials_sheen.sheenRoughnessFactor", Number),
    ("materials[].extensions.KHR_materials_specular.specularFactor", Number),
    ("materials[].extensions.KHR_materials_specular.specularColorFactor", Numbers(3)),
    ("materials[].extensions.KHR_materials_transmission.transmissionFactor", Number),
    ("materials[].extensions.KHR_materials_volume.thicknessFactor", Number),
    ("materials[].extensions.KHR_materials_volume.attenuationColor", Numbers(3)),
    ("materials[].extensions.KHR_materials_volume.attenuationDistance", Number),
    ("materials[].@", Object),
    ("materials[].@.index", Index("textures")),
    ("materials[].@.texCoord", Whole),
    ("materials[].@.extensions.KHR_texture_transform.offset", Numbers(2)),
    ("materials[].@.extensions.KHR_texture_transform.scale", Numbers(2)),
    ("materials[].@.extensions.KHR_texture_transform.rotation", Number),
    ("materials[].@.extensions.KHR_texture_transform.texCoord", Whole),
];

/// Members of a material that refer to a texture.
const TEXTURES: &[&str] = &[
    "normalTexture",
    "emissiveTexture",
    "pbrMetallicRoughness.baseColorTexture",
    "pbrMetallicRoughness.metallicRoughnessTexture",
    "extensions.KHR_materials_anisotropy.anisotropyTexture",
    "extensions.KHR_materials_clearcoat.clearcoatTexture",
    "extensions.KHR_materials_clearcoat.clearcoatRoughnessTexture",
    "extensions.KHR_materials_pbrSpecularGlossiness.diffuseTexture",
    "extensions.KHR_materials_pbrSpecularGlossiness.specularGlossinessTexture",
    "extensions.KHR_materials_sheen.sheenColorTexture",
    "extensions.KHR_materials_sheen.sheenRoughnessTexture",
    "extensions.KHR_materials_specular.specularTexture",
    "extensions.KHR_materials_specular.specularColorTexture",
    "extensions.KHR_materials_transmission.transmissionTexture",
];

/// Rules as a tree: the required type of a value, and the rules of its children. One traversal of a document checks all
/// of them; absent extensions take no time.
#[derive(Default)]
struct Level {
    rules: Vec<Rule>,
    members: Vec<(&'static str, Level)>,
    any_member: Option<Box<Level>>,
    elements: Option<Box<Level>>,
}

static LEVELS: LazyLock<Level> = LazyLock::new(|| {
    let mut root = Level::default();
    for &(path, rule) in RULES {
        match path.split_once('@') {
            Some((before, after)) => {
                let material = root.below(before.trim_end_matches('.'));
                TEXTURES.iter().for_each(|texture| material.below(texture).below(after).rules.push(rule));
            }
            None => root.below(path).rules.push(rule),
        }
    }
    root
});

impl Level {
    /// The level at a path relative to this one.
    fn below(&mut self, path: &'static str) -> &mut Level {
        path.split('.').filter(|part| !part.is_empty()).fold(self, |level, part| {
            let level = match part.trim_end_matches("[]") {
                "*" => level.any_member.get_or_insert_default(),
                name => level.member(name),
            };
            if part.ends_with("[]") { level.elements.get_or_insert_default() } else { level }
        })
    }

    fn member(&mut self, name: &'static str) -> &mut Level {
        let index = self.members.iter().position(|(other, _)| *other == name).unwrap_or_else(|| {
            self.members.push((name, Level::default()));
            self.members.len() - 1
        });
        &mut self.members[index].1
    }

    /// Checks a value and all its children; stops at the limit of errors.
    fn check(&self, root: &Place<'_>, place: &Place<'_>, errors: &mut Vec<GltfError>) {
        for rule in &self.rules {
            errors.extend(rule.check(root, place).err().map(|message| place.error(message)));
        }
        let mut check = |level: &Level, place: &Place<'_>| {
            if errors.len() < MAX_ERRORS {
                level.check(root, place, errors);
            }
        };
        for (name, level) in &self.members {
            Some(place.key(name)).filter(Place::exists).iter().for_each(|place| check(level, place));
        }
        if let Some(level) = &self.any_member {
            place.members().for_each(|(_, place)| check(level, &place));
        }
        if let Some(level) = &self.elements {
            place.items().for_each(|place| check(level, &place));
        }
    }
}

/// All violations, up to a limit.
pub fn errors(root: &Place<'_>) -> Vec<GltfError> {
    let mut errors = Vec::new();
    LEVELS.check(root, root, &mut errors);
    errors
}

impl Rule {
    fn check(self, root: &Place<'_>, place: &Place<'_>) -> Result<(), String> {
        let holds = match self {
            Index(array) => return check_index(place, &root.key(array)),
            Light => return check_index(place, &root.extension("KHR_lights_punctual").key("lights")),
            OneOf(values) => {
                let is_one = place.index().is_some_and(|v| values.contains(&v));
                return if is_one { Ok(()) } else { Err(format!("must be one of {values:?}")) };
            }
            Numbers(count) => {
                let is_right = place.len() == count && place.items().all(|n| n.number().is_some());
                return if is_right { Ok(()) } else { Err(format!("must be {count} numbers")) };
            }
            Word(words) => {
                let is_one = place.text().is_some_and(|text| words.contains(&text));
                return if is_one { Ok(()) } else { Err(format!("must be one of {}", words.join(", "))) };
            }
            Positive => place.number().is_some_and(|x| x > 0.0),
            NotNegative => place.number().is_some_and(|x| x >= 0.0),
            Number => place.number().is_some(),
            Whole => place.index().is_some(),
            Text => place.text().is_some(),
            Flag => place.flag().is_some(),
            Array => place.is_array(),
            Object => place.is_object(),
        };
        let what = match self {
            Number => "a number",
            Positive => "a number above 0",
            NotNegative => "a number that is not negative",
            Text => "text",
            Flag => "true or false",
            Array => "an array",
            Object => "an object",
            Index(_) | Light | Numbers(_) | OneOf(_) | Word(_) | Whole => "an integer that is not negative",
        };
        if holds { Ok(()) } else { Err(format!("must be {what}")) }
    }
}

fn check_index(place: &Place<'_>, array: &Place<'_>) -> Result<(), String> {
    let Some(index) = place.index() else { return Err("must be an integer that is not negative".to_owned()) };
    let count = array.len();
    if index < count { Ok(()) } else { Err(format!("{}[{index}] is not there, of {count}", array.path())) }
}

#[cfg(test)]
mod tests {
    use super::super::json::{Json, WORK};
    use super::*;

    fn messages(json: &str) -> Vec<String> {
        errors(&Place::root(&Json::parse(json.as_bytes()).unwrap())).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn what_is_not_there_or_of_another_type_is_named() {
        let nodes = r#"{"scene":2.0,"scenes":[{"nodes":[0,1]}],"nodes":[{"scale":[1,2],"mesh":"a"}]}"#;
        assert_eq!(
            messages(nodes),
            [
                "scene: scenes[2] is not there, of 1",
                "scenes[0].nodes[1]: nodes[1] is not there, of 1",
                "nodes[0].mesh: must be an integer that is not negative",
                "nodes[0].scale: must be 3 numbers"
            ]
        );
        let hidden = r#"{"nodes":[{"extensions":{"KHR_node_visibility":{"visible":0}}}]}"#;
        assert_eq!(messages(hidden), ["nodes[0].extensions.KHR_node_visibility.visible: must be true or false"]);
        let materials = r#"{"materials":[{"doubleSided":1,"normalTexture":{"index":0,"scale":"a"}}],"samplers":[
            {"wrapS":7}],"images":{},"meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":-1}}]}]}"#;
        assert_eq!(messages(materials).len(), 7);
        assert_eq!(messages(r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{}]}"#), [""; 0]);
    }

    #[test]
    fn words_and_ranges_are_those_of_the_specification() {
        let of_light =
            |light: &str| messages(&format!(r#"{{"extensions":{{"KHR_lights_punctual":{{"lights":[{light}]}}}}}}"#));
        let place = "extensions.KHR_lights_punctual.lights[0]";
        assert_eq!(of_light(r#"{"type":"area"}"#), [format!("{place}.type: must be one of directional, point, spot")]);
        assert_eq!(
            of_light(r#"{"intensity":-5}"#),
            [format!("{place}.intensity: must be a number that is not negative")]
        );
        assert_eq!(of_light(r#"{"type":"spot","intensity":0}"#), [""; 0]);
        let rest = r#"{"cameras":[{"type":"panoramic","perspective":{"yfov":-1}}],"materials":[{"alphaMode":"mask"}]}"#;
        assert_eq!(
            messages(rest),
            [
                "cameras[0].type: must be one of perspective, orthographic",
                "cameras[0].perspective.yfov: must be a number above 0",
                "materials[0].alphaMode: must be one of OPAQUE, MASK, BLEND",
            ]
        );
    }

    #[test]
    fn factors_and_textures_of_all_extensions_of_materials_are_checked() {
        let of = |extension: &str, members: &str| {
            messages(&format!(r#"{{"materials":[{{"extensions":{{"KHR_materials_{extension}":{{{members}}}}}}}]}}"#))
        };
        for (extension, texture) in [
            ("anisotropy", "anisotropyTexture"),
            ("clearcoat", "clearcoatRoughnessTexture"),
            ("sheen", "sheenColorTexture"),
            ("sheen", "sheenRoughnessTexture"),
            ("specular", "specularTexture"),
            ("transmission", "transmissionTexture"),
        ] {
            let place = format!("materials[0].extensions.KHR_materials_{extension}.{texture}.index");
            let expected = [format!("{place}: textures[7] is not there, of 0")];
            assert_eq!(of(extension, &format!(r#""{texture}":{{"index":7}}"#)), expected);
        }
        let said = of("sheen", r#""sheenColorFactor":"x","sheenRoughnessFactor":[1]"#).join("\n");
        assert!(said.contains("sheenColorFactor: must be 3 numbers"), "{said}");
        assert!(said.contains("sheenRoughnessFactor: must be a number"), "{said}");
        let said = of("volume", r#""attenuationColor":1,"attenuationDistance":"far""#).join("\n");
        assert!(said.contains("attenuationColor: must be 3 numbers"), "{said}");
        assert!(said.contains("attenuationDistance: must be a number"), "{said}");
    }

    #[test]
    fn twice_as_many_elements_take_twice_the_work() {
        let work = |n: usize| {
            let all = |element: &dyn Fn(usize) -> String| (0..n).map(element).collect::<Vec<_>>().join(",");
            let text = format!(
                r#"{{"scenes":[{{"nodes":[{}]}}],"nodes":[{}],"meshes":[{}],"materials":[{}],"accessors":[{}]}}"#,
                all(&|i| i.to_string()),
                all(&|i| format!(r#"{{"mesh":{i},"children":[{}],"translation":[0,0,{i}]}}"#, n - 1 - i)),
                all(&|i| format!(r#"{{"primitives":[{{"attributes":{{"POSITION":{i}}},"material":{i}}}]}}"#)),
                all(&|i| format!(r#"{{"name":"{i}","pbrMetallicRoughness":{{"metallicFactor":0.5}}}}"#)),
                all(&|i| format!(r#"{{"count":{i},"type":"VEC3","componentType":5126}}"#)),
            );
            let json = Json::parse(text.as_bytes()).unwrap();
            WORK.set(0);
            assert!(errors(&Place::root(&json)).is_empty());
            WORK.get()
        };
        let [few, many] = [100, 200].map(work);
        assert!(few > 100 && many as f64 <= 2.1 * few as f64, "{few} values, then {many}");
    }

    #[test]
    fn a_file_of_errors_has_a_limit() {
        let nodes = vec![r#"{"mesh":1}"#; 100].join(",");
        assert_eq!(messages(&format!(r#"{{"nodes":[{nodes}]}}"#)).len(), MAX_ERRORS);
    }
}
