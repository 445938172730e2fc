//! `MakeNamedMedium` of type `nanovdb`: its parameters, and the medium after its file has been read.

use super::checks::file_name;
use super::descriptions::{GridName, VolumeDesc};
use super::media::{asymmetry, glowing, not_negative};
use super::state::Builder;
use crate::import::cache::FileCache;
use crate::import::volumes::{Volume, VolumeRequest, VolumeUse};
use crate::media::{Field, Heterogeneous, Medium, Scalars, SparseSamples, UniformGrid};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::names::file_in;
use lumiris_formats::nanovdb::{GridClass, NanoError};
use lumiris_formats::pbrt::params::ParamSet;
use lumiris_numbers::math::{DAffine3, DVec3, Rgb};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

/// Requests of all media, and their results.
type Volumes = HashMap<VolumeRequest, Result<Arc<Volume>, NanoError>>;

fn request(path: &Path, grid: &GridName, usage: VolumeUse) -> VolumeRequest {
    VolumeRequest { path: path.to_owned(), grid: grid.text.clone(), usage }
}

impl Builder<'_> {
    /// The description from the parameters; `None` after an error.
    pub(super) fn nanovdb(&self, p: &ParamSet, placement: DAffine3, d: &mut Diagnostics) -> Option<VolumeDesc> {
        let scale = not_negative(p, "scale", 1.0, d);
        let le_scale = not_negative(p, "Lescale", 1.0, d);
        let g = asymmetry(p, d);
        let offset = p.float("temperatureoffset", d);
        let offset = offset.or_else(|| p.float("temperaturecutoff", d)).unwrap_or(0.0);
        let temperature_scale = p.float("temperaturescale", d).unwrap_or(1.0);
        for (key, value) in [("temperatureoffset", offset), ("temperaturescale", temperature_scale)] {
            if !value.is_finite() {
                d.error(p.span_of(key), format!("{key} must be finite"));
            }
        }

        // Names of the grids
        let density = p.string("gridname", d).unwrap_or("density").to_owned();
        let density = GridName { text: density, span: Some(p.span_of("gridname")) };
        let named = p.string("temperaturename", d).map(str::to_owned);
        let span = named.is_some().then(|| p.span_of("temperaturename"));
        let temperature = GridName { text: named.unwrap_or_else(|| "temperature".to_owned()), span };
        let coefficients = self.coefficients(p, scale, d);

        // Description
        let Some(name) = file_name(p, "filename", d) else {
            d.error(p.span, "a nanovdb medium needs `string filename`");
            return None;
        };
        let [sigma_a, sigma_s] = coefficients?;
        Some(VolumeDesc {
            path: file_in(&self.folder, name),
            span: p.span_of("filename"),
            density,
            temperature: (le_scale > 0.0).then_some(temperature),
            offset,
            scale: temperature_scale,
            sigma_a,
            sigma_s,
            le_scale,
            g,
            placement,
        })
    }

    /// The grids of all media.
    pub(super) fn volume_requests(&self) -> HashSet<VolumeRequest> {
        let mut requests = HashSet::new();
        for desc in self.media.iter().filter_map(|m| m.volume.as_ref()) {
            requests.insert(request(&desc.path, &desc.density, VolumeUse::Density));
            let temperature = desc.temperature.as_ref();
            requests.extend(temperature.map(|grid| request(&desc.path, grid, VolumeUse::Temperature)));
        }
        requests
    }

    /// Reads the files of all media.
    pub(super) fn load_volumes(&mut self, files: &FileCache, d: &mut Diagnostics) {
        let read = |request: VolumeRequest| (files.volume(&request), request);
        let volumes: Volumes =
            self.volume_requests().into_par_iter().map(read).map(|(volume, request)| (request, volume)).collect();
        for medium in &mut self.media {
            if let Some(desc) = &medium.volume {
                medium.medium = medium_of(desc, &volumes, d);
            }
        }
    }
}

/// The grid, if it was read and is a volume; errors go to `d`.
fn checked(
    desc: &VolumeDesc,
    name: &GridName,
    read: Option<&Result<Arc<Volume>, NanoError>>,
    d: &mut Diagnostics,
) -> Option<Arc<Volume>> {
    let (text, span) = (&name.text, name.span.unwrap_or(desc.span));
    match read? {
        Ok(volume) if [GridClass::UNKNOWN, GridClass::FOG_VOLUME].contains(&volume.class) => {
            // Negative values and NaN were replaced by 0
            if volume.replaced > 0 {
                let what = "values that are negative or no numbers are taken for 0";
                let message = format!("{}: grid `{text}`: {} {what}", desc.path.display(), volume.replaced);
                d.warning_once(span, message);
            }
            Some(Arc::clone(volume))
        }
        Ok(volume) => {
            let message = format!("{}: grid `{text}` is {}, and no fog volume", desc.path.display(), volume.class);
            d.error(span, message);
            None
        }
        Err(NanoError::Io { source, .. }) => {
            d.missing_file(desc.path.clone(), source, Some(desc.span));
            None
        }
        Err(error @ NanoError::NoGrid { .. }) => {
            d.error(span, format!("{} {error}", desc.path.display()));
            None
        }
        Err(error) => {
            d.error(desc.span, format!("{} {error}", desc.path.display()));
            None
        }
    }
}

/// The medium of a description; `None` after an error.
fn medium_of(desc: &VolumeDesc, volumes: &Volumes, d: &mut Diagnostics) -> Option<Medium> {
    let density = volumes.get(&request(&desc.path, &desc.density, VolumeUse::Density));
    let density = checked(desc, &desc.density, density, d)?;
    let mut hot = None;
    if let Some(name) = &desc.temperature {
        let read = volumes.get(&request(&desc.path, name, VolumeUse::Temperature));
        match (read, name.span) {
            // As in pbrt-v4, there is no emission then
            (Some(Err(NanoError::NoGrid { .. })), None) => {}
            (Some(Err(error @ NanoError::NoGrid { .. })), Some(span)) => {
                d.warning_once(span, format!("{} {error}: nothing glows", desc.path.display()));
            }
            _ => hot = Some(checked(desc, name, read, d)?),
        }
    }

    // The union of both boxes
    let boxes = [density.bounds, hot.as_ref().and_then(|hot| hot.bounds)].into_iter().flatten();
    let joined = boxes.map(|b| b.map(DVec3::from_array)).reduce(|[a, b], [c, e]| [a.min(c), b.max(e)]);
    let bounds @ [min, max] = joined.unwrap_or([DVec3::ZERO, DVec3::ONE]);
    let size = (max - min).as_vec3();
    if !(size.min_element() > 0.0 && size.is_finite()) {
        d.error(desc.span, format!("{}: its box from {min} to {max} has no volume", desc.path.display()));
        return None;
    }
    let placed = |volume: &Volume| SparseSamples::new(Arc::clone(&volume.grid), &volume.space_from_index, &bounds);
    let (Some(samples), Some(hot)) = (placed(&density), hot.map_or(Some(None), |hot| placed(&hot).map(Some))) else {
        d.error(desc.span, format!("{}: the map of a grid has no inverse", desc.path.display()));
        return None;
    };
    let temperature = hot.map(|samples| glowing(Scalars::Sparse(samples), desc.offset, desc.scale));
    let le = if temperature.is_some() { Rgb::splat(desc.le_scale) } else { Rgb::BLACK };
    let density = Scalars::Sparse(samples);
    let grid = UniformGrid { sigma_a: desc.sigma_a, sigma_s: desc.sigma_s, density, le, le_scale: None, temperature };
    let medium = Heterogeneous::new(Field::Uniform(grid), bounds, &desc.placement, desc.g);
    Some(Medium::Heterogeneous(Arc::new(medium)))
}
