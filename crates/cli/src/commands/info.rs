//! `lumiris info` for scenes. Images and parts are in [`super::info_file`].

use super::args::SceneArgs;
use super::info_file::facts_of_file;
use super::progress;
use super::settings::{Setup, load_job};
use clap::Args;
use lumiris::geometry::{Member, Shape};
use lumiris::import::memory::{peak_resident, resident};
use lumiris::lights::Light;
use lumiris::render::RenderSettings;
use lumiris::render::memory::{Wanted, predict};
use lumiris::render::output::metadata;
use lumiris::scene::{Choices, RenderJob, Scene};
use lumiris::settings::{Setting, Value as SettingValue};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::process::ExitCode;

/// `lumiris info`
#[derive(Args, Clone, Debug)]
pub(super) struct InfoArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &InfoArgs) -> anyhow::Result<ExitCode> {
    let facts = match facts_of_file(&args.scene.scene)? {
        Some(facts) => facts,
        None => {
            let Setup { job, times, .. } = load_job(&args.scene)?;
            let mut facts = facts(&job);
            facts["seconds"] = json!({ "load": times.load, "build": times.build });
            facts["scene"] = json!(args.scene.scene.display().to_string());
            let Choices { cameras, scenes, .. } = &job.world.scene.choices;
            let choices = [("cameras", cameras), ("scenes", scenes)];
            // A single unnamed camera or scene is no choice
            let is_choice = |all: &[String]| all.len() > 1 || all.iter().any(|name| !name.is_empty());
            choices.into_iter().filter(|(_, all)| is_choice(all)).for_each(|(key, all)| facts[key] = json!(all));
            facts
        }
    };
    if args.json {
        progress::print(&serde_json::to_string_pretty(&facts)?)?;
    } else {
        let mut text = String::new();
        list(&facts, 0, false, &mut text);
        progress::print(text.trim_end())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Contents, memory and settings of a scene, as JSON.
fn facts(job: &RenderJob) -> Value {
    // Geometry
    let scene = &job.world.scene;
    let set = &scene.geometry;
    let counts = set.primitive_counts();
    let group_triangles = |group: &lumiris::geometry::Group| -> usize {
        let meshes = group.geometries.iter().map(|&id| match &set.geometries[id as usize].shape {
            Shape::Mesh(mesh) => mesh.triangle_count(),
            Shape::Quadric(_) | Shape::Bilinear(_) | Shape::Curves(_) => 0,
        });
        meshes.sum()
    };
    let per_group: Vec<usize> = set.groups.iter().map(group_triangles).collect();
    let per_cluster = |members: &Vec<Member>| members.iter().map(|m| per_group[m.group as usize]).sum::<usize>();
    let per_cluster: Vec<usize> = set.clusters.clusters().iter().map(per_cluster).collect();
    let in_clusters: usize = set.clusters.places().iter().map(|place| per_cluster[place.cluster as usize]).sum();
    let instanced = in_clusters + set.instances.iter().map(|i| per_group[i.group as usize]).sum::<usize>();
    let bounds = set.world_bounds();
    let bounds = [bounds.min, bounds.max].map(|corner| (corner.as_dvec3() + scene.origin).to_array());

    // Materials and lights
    let mut materials: BTreeMap<&str, usize> = BTreeMap::new();
    for entry in scene.materials.entries() {
        *materials.entry(entry.material.kind_name()).or_default() += 1;
    }
    let mut lights: BTreeMap<&str, usize> = BTreeMap::new();
    for light in scene.lights.lights.iter().filter(|light| !matches!(light, Light::Volume(_))) {
        *lights.entry(light.kind_name()).or_default() += 1;
    }

    let media = scene.media.names.iter().zip(&scene.media.media);
    let media: BTreeMap<&String, &str> = media.map(|(name, medium)| (name, medium.kind_name())).collect();

    // Report
    let accel = job.world.accel.stats();
    let settings = job.settings();
    let changed = |(row, value): (&Setting, SettingValue)| (format!("--{}", row.flag), value.to_string());
    json!({
        "geometry": {
            "geometries": set.geometries.len(),
            "curves": counts.curves, "curve_pieces": counts.curve_pieces,
            "triangles": counts.triangles, "quadrics": counts.quadrics, "patches": counts.patches,
            "groups": set.groups.len(),
            "instances": set.instances.len() + set.clusters.instance_count() as usize,
            "triangles_with_instances": group_triangles(&set.root) + instanced,
            "bounds": bounds,
        },
        "materials": materials,
        "lights": lights,
        "media": media,
        "textures": {
            "float": scene.textures.floats.len(), "rgb": scene.textures.rgbs.len(),
            "images": scene.textures.images.len(), "face_maps": scene.textures.face_maps.len(),
        },
        "memory": {
            "geometry_bytes": geometry_bytes(scene),
            "medium_bytes": scene.media.media.iter().map(|m| m.bytes() as u64).sum::<u64>(),
            "texture_bytes": scene.textures.bytes(),
            "texture_bytes_in_tiles": scene.textures.store().map_or(0, |s| s.counts().stored),
            "texture_tiles_at_most_bytes": scene.textures.store().map_or(0, |s| s.capacity()),
            "accel_bytes": accel.bytes, "accel_peak_bytes": accel.peak_bytes,
            "taken_bytes": resident(), "most_taken_bytes": peak_resident(),
            "predicted_with_all_layers": predicted(job, true),
            "predicted_without_layers": predicted(job, false),
        },
        "settings": metadata(&scene.film, settings).into_iter().collect::<BTreeMap<_, _>>(),
        "changed_settings": settings.changed().map(changed).collect::<BTreeMap<_, _>>(),
    })
}

/// Predicted memory for rendering (bytes): beyond the scene, and the peak including the scene.
fn predicted(job: &RenderJob, has_layers: bool) -> Value {
    let spp = job.settings().sampling.spp;
    let render =
        RenderSettings { spp, with_features: has_layers, with_replicas: has_layers, ..RenderSettings::default() };
    let prediction = predict(job, &Wanted { render: &render, cryptomattes: &[], is_denoised: false });
    let pixels = job.world.scene.film.bounds.area().max(1) as u64;
    json!({
        "bytes": prediction.bytes(), "peak_bytes": peak_resident().max(resident() + prediction.bytes()),
        "film_bytes": prediction.film, "film_bytes_per_pixel": prediction.film / pixels,
        "output_bytes": prediction.output, "fixed_bytes": prediction.fixed,
    })
}

fn geometry_bytes(scene: &Scene) -> u64 {
    let bytes = scene.geometry.geometries.iter().map(|g| match &g.shape {
        Shape::Mesh(m) => {
            let vectors = m.padded_positions().len() + m.normals.len() + m.tangents.len() + m.indices.len();
            vectors * 12 + m.uvs.len() * 8 + m.faces.len() * 4
        }
        Shape::Quadric(q) => size_of_val(q),
        Shape::Curves(curves) => curves.bytes(),
        Shape::Bilinear(m) => {
            (m.positions.len() + m.normals.len()) * 12 + m.uvs.len() * 8 + m.indices.len() * 16 + m.faces.len() * 4
        }
    });
    bytes.sum::<usize>() as u64
}

/// Objects whose keys are names from a file, and are printed unchanged.
const VERBATIM: [&str; 2] = ["layers", "metadata"];

/// Writes a JSON object as an indented list. Underscores in keys become spaces, except for verbatim keys.
fn list(value: &Value, indent: usize, is_verbatim: bool, out: &mut String) {
    let Value::Object(map) = value else { return };
    for (key, value) in map {
        let words = if is_verbatim { key.clone() } else { key.replace('_', " ") };
        let name = format!("{:indent$}{words}", "");
        match value {
            Value::Object(_) => {
                *out += &format!("{name}\n");
                list(value, indent + 2, VERBATIM.contains(&key.as_str()), out);
            }
            Value::String(text) => *out += &format!("{name:<34}{text}\n"),
            other => *out += &format!("{name:<34}{other}\n"),
        }
    }
}
