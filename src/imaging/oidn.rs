//! Denoising by Open Image Denoise 2: safe wrapper of the C interface.
//!
//! The library is loaded when a [`Denoiser`] is opened. The guides, albedo and normal of the first surface, are noisy
//! themselves with depth of field, motion or texture. Each guide is therefore denoised first, and the image is denoised
//! with the clean guides. Non-finite values are first replaced by the mean of their finite neighbours: a single one
//! would corrupt all pixels in the network's receptive field.
#![allow(unsafe_code)]

use oidn_sys as sys;
use std::ffi::{CStr, c_char};
use std::path::Path;
use std::ptr;

/// Installation hint at the end of messages.
const HELP: &str = "denoising needs the library Open Image Denoise 2 (openimagedenoise.org, or a package of the system): \
                    install it, or name its file";

/// Reason why an image cannot be denoised.
#[derive(Debug, thiserror::Error)]
pub enum DenoiseError {
    /// The library cannot be loaded.
    #[error("Open Image Denoise cannot be loaded: {0}\n{HELP}")]
    Library(String),
    /// The library reports an error.
    #[error("Open Image Denoise: {0}")]
    Device(String),
    /// A layer has another size than the image.
    #[error("the layer {0} does not have the size of the image")]
    Size(&'static str),
}

/// An image to denoise: three values per pixel, row-major from the top left.
#[derive(Clone, Debug, Default)]
pub struct NoisyImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear colour.
    pub color: Vec<f32>,
    /// Albedo of the first surface, 0..1.
    pub albedo: Option<Vec<f32>>,
    /// Normal of the first surface, −1..1. Used only together with albedo.
    pub normal: Option<Vec<f32>>,
}

/// An Open Image Denoise device on the CPU.
#[derive(Debug)]
pub struct Denoiser {
    api: sys::Api,
    device: *mut sys::OidnDevice,
}

impl Denoiser {
    /// Opens the given library, or the system's, with the given number of threads; `None` is one per core.
    pub fn open(library: Option<&Path>, threads: Option<usize>) -> Result<Self, DenoiseError> {
        let name = library.map_or_else(|| sys::LIBRARY_NAME.as_ref(), Path::as_os_str);
        let api = sys::load(name).map_err(DenoiseError::Library)?;
        // SAFETY: a device is made and owned; null is handled here.
        let device = unsafe { (api.new_device)(sys::OIDN_DEVICE_TYPE_CPU) };
        if device.is_null() {
            return Err(DenoiseError::Library(device_error(&api, device).err().unwrap_or_default()));
        }
        let denoiser = Denoiser { api, device };
        let threads = threads.map_or(0, |n| i32::try_from(n).unwrap_or(i32::MAX));
        // SAFETY: the device is live until drop, and names end in a zero byte, here and below.
        unsafe {
            (api.set_device_int)(device, c"numThreads".as_ptr(), threads);
            // Programs on the same machine would otherwise pin their threads to the same cores
            (api.set_device_bool)(device, c"setAffinity".as_ptr(), false);
            (api.commit_device)(device);
        }
        denoiser.check().map_err(|error| DenoiseError::Library(error.to_string()))?;
        Ok(denoiser)
    }

    /// The library's version, such as `2.5.1`.
    pub fn version(&self) -> String {
        let number = |name: &CStr| {
            // SAFETY: as above.
            unsafe { (self.api.get_device_int)(self.device, name.as_ptr()) }.to_string()
        };
        [c"versionMajor", c"versionMinor", c"versionPatch"].map(number).join(".")
    }

    /// Denoises an image with its guides, which are denoised first. A normal without albedo is ignored.
    pub fn denoise(&self, mut image: NoisyImage) -> Result<Vec<f32>, DenoiseError> {
        let size = [image.width, image.height];
        let guides = [("albedo", &image.albedo), ("normal", &image.normal)];
        let layers = guides.into_iter().filter_map(|(name, layer)| Some((name, layer.as_ref()?)));
        let expected = image.width.checked_mul(image.height).and_then(|n| n.checked_mul(3));
        for (name, layer) in layers.chain([("color", &image.color)]) {
            if Some(layer.len()) != expected {
                return Err(DenoiseError::Size(name));
            }
        }
        if image.color.is_empty() {
            return Ok(Vec::new());
        }

        // Denoise the guides
        let clean = |name: &CStr, layer: Option<Vec<f32>>, min: f32| {
            let Some(mut layer) = layer else { return Ok(None) };
            repair(&mut layer, image.width, min, 1.0);
            self.filter(size, &[(name, &layer)], &[]).map(Some)
        };
        let albedo = clean(c"albedo", image.albedo.take(), 0.0)?;
        let normal = image.normal.take().filter(|_| albedo.is_some());
        let normal = clean(c"normal", normal, -1.0)?;

        // Denoise the image
        repair(&mut image.color, image.width, 0.0, f32::MAX);
        let mut inputs = vec![(c"color", &image.color[..])];
        inputs.extend(albedo.iter().map(|layer| (c"albedo", &layer[..])));
        inputs.extend(normal.iter().map(|layer| (c"normal", &layer[..])));
        let flags = if albedo.is_some() { &[c"hdr", c"cleanAux"][..] } else { &[c"hdr"] };
        self.filter(size, &inputs, flags)
    }

    /// Runs a filter. All images have three values per pixel.
    fn filter(
        &self,
        [width, height]: [usize; 2],
        inputs: &[(&CStr, &[f32])],
        flags: &[&CStr],
    ) -> Result<Vec<f32>, DenoiseError> {
        let mut output = vec![0.0; width * height * 3];
        // SAFETY: the device is live.
        let handle = unsafe { (self.api.new_filter)(self.device, c"RT".as_ptr()) };
        self.check()?;
        let filter = Filter { api: &self.api, handle };
        let set = |name: &CStr, data: *mut f32| {
            let format = sys::OIDN_FORMAT_FLOAT3;
            // SAFETY: the filter is live. All images hold width × height × 3 floats and outlive it. Inputs are only
            // read.
            unsafe {
                let set = self.api.set_shared_filter_image;
                set(filter.handle, name.as_ptr(), data.cast(), format, width, height, 0, 0, 0);
            }
        };
        for (name, layer) in inputs {
            if layer.len() != output.len() {
                return Err(DenoiseError::Size("input"));
            }
            set(name, layer.as_ptr().cast_mut());
        }
        set(c"output", output.as_mut_ptr());
        for flag in flags {
            // SAFETY: the filter is live.
            unsafe { (self.api.set_filter_bool)(filter.handle, flag.as_ptr(), true) };
        }
        // SAFETY: as above; a filter with an error is not executed.
        unsafe { (self.api.commit_filter)(filter.handle) };
        self.check()?;
        // SAFETY: as above.
        unsafe { (self.api.execute_filter)(filter.handle) };
        self.check()?;
        drop(filter);
        Ok(output)
    }

    /// Returns the device's error, if there is one.
    fn check(&self) -> Result<(), DenoiseError> {
        device_error(&self.api, self.device).map_err(DenoiseError::Device)
    }
}

impl Drop for Denoiser {
    fn drop(&mut self) {
        // SAFETY: the device is live, and released once.
        unsafe { (self.api.release_device)(self.device) };
    }
}

/// A filter, released on drop.
struct Filter<'a> {
    api: &'a sys::Api,
    handle: *mut sys::OidnFilter,
}

impl Drop for Filter<'_> {
    fn drop(&mut self) {
        // SAFETY: the filter is live, and released once.
        unsafe { (self.api.release_filter)(self.handle) };
    }
}

/// The error message of a device. A null device stands for devices that could not be created.
fn device_error(api: &sys::Api, device: *mut sys::OidnDevice) -> Result<(), String> {
    let mut message: *const c_char = ptr::null();
    // SAFETY: the device is live or null, and `message` is only written.
    let code = unsafe { (api.get_device_error)(device, &mut message) };
    if code == sys::OIDN_ERROR_NONE {
        return Ok(());
    }
    if message.is_null() {
        return Err(format!("error {code}"));
    }
    // SAFETY: the message ends in a zero byte and lives until the next question; its bytes are copied here.
    Err(unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned())
}

/// Clamps all values. Non-finite pixels are replaced by the mean of their finite neighbours, or by 0.
fn repair(data: &mut [f32], width: usize, min: f32, max: f32) {
    let (pixels, _) = data.as_chunks_mut::<3>();
    let is_finite = |pixel: &[f32; 3]| pixel.iter().all(|v| v.is_finite());
    let broken: Vec<usize> = (0..pixels.len()).filter(|&i| !is_finite(&pixels[i])).collect();
    let height = pixels.len() / width.max(1);
    let around = |i: usize| {
        let (x, y) = (i % width, i / width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.flat_map(move |y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x))
    };
    // Means use the original values only, so that the order does not matter
    let mean = |i: usize| {
        let neighbours: Vec<[f32; 3]> = around(i).map(|j| pixels[j]).filter(is_finite).collect();
        let count = neighbours.len().max(1) as f32;
        std::array::from_fn(|c| neighbours.iter().map(|p| p[c] / count).sum())
    };
    let repaired: Vec<[f32; 3]> = broken.iter().map(|&i| mean(i)).collect();
    broken.into_iter().zip(repaired).for_each(|(i, pixel)| pixels[i] = pixel);
    data.iter_mut().for_each(|v| *v = v.clamp(min, max));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_library_that_is_not_there_is_an_error_that_says_how_to_get_it() {
        let error = Denoiser::open(Some(Path::new("/nowhere/lib.so")), None).unwrap_err().to_string();
        assert!(error.contains("/nowhere/lib.so") && error.ends_with(HELP), "{error}");
    }

    #[test]
    fn pixels_that_are_not_finite_become_the_mean_of_their_neighbours() {
        let mut data = vec![1.0; 27];
        data[12..15].copy_from_slice(&[f32::NAN, 5.0, 5.0]);
        data[0] = f32::INFINITY;
        data[26] = 9.0;
        repair(&mut data, 3, 0.0, 8.0);
        assert_eq!(data[0], 1.0);
        assert_eq!(data[12..15], [1.0, 1.0, 15.0 / 7.0]);
        assert_eq!(data[26], 8.0);
        let mut lone = vec![f32::NAN, f32::NEG_INFINITY, 1.0];
        repair(&mut lone, 1, -1.0, 1.0);
        assert_eq!(lone, [0.0; 3]);
    }

    fn denoiser(threads: usize) -> Denoiser {
        let library = std::env::var_os("LUMIRIS_OIDN").expect("LUMIRIS_OIDN names the library");
        Denoiser::open(Some(Path::new(&library)), Some(threads)).unwrap()
    }

    /// A grey image of noise with mean 0.5, an albedo guide with an edge, and normals towards the viewer.
    fn noisy(width: usize, height: usize) -> NoisyImage {
        let value = |i: usize| (i as u32).wrapping_mul(2_654_435_761) as f32 / u32::MAX as f32;
        let color = (0..width * height).flat_map(|i| [value(i); 3]).collect();
        let albedo = (0..width * height).flat_map(|i| [if i % width < width / 2 { 0.2 } else { 0.8 }; 3]).collect();
        let normal = (0..width * height).flat_map(|_| [0.0, 0.0, 1.0]).collect();
        NoisyImage { width, height, color, albedo: Some(albedo), normal: Some(normal) }
    }

    fn variance(data: &[f32]) -> f64 {
        let mean = data.iter().map(|v| f64::from(*v)).sum::<f64>() / data.len() as f64;
        data.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / data.len() as f64
    }

    #[test]
    #[ignore = "needs Open Image Denoise: make test-denoise"]
    fn noise_is_removed_with_and_without_guides() {
        let denoiser = denoiser(1);
        assert!(denoiser.version().starts_with("2."), "{}", denoiser.version());
        let noisy = noisy(64, 48);
        let without = |image: NoisyImage, albedo: bool, normal: bool| NoisyImage {
            albedo: image.albedo.filter(|_| albedo),
            normal: image.normal.filter(|_| normal),
            ..image
        };
        for (albedo, normal) in [(true, true), (true, false), (false, true), (false, false)] {
            let clean = denoiser.denoise(without(noisy.clone(), albedo, normal)).unwrap();
            let ratio = variance(&clean) / variance(&noisy.color);
            assert!(clean.len() == noisy.color.len() && ratio < 0.1, "{albedo} {normal}: {ratio}");
        }
    }

    #[test]
    #[ignore = "needs Open Image Denoise: make test-denoise"]
    fn the_result_does_not_depend_on_the_number_of_threads() {
        let [one, four] = [1, 4].map(|threads| denoiser(threads).denoise(noisy(200, 150)).unwrap());
        assert!(one == four);
    }

    #[test]
    #[ignore = "needs Open Image Denoise: make test-denoise"]
    fn values_that_are_not_finite_and_images_of_a_pixel_or_none_do_no_harm() {
        let denoiser = denoiser(1);
        let mut broken = noisy(32, 32);
        broken.color[300] = f32::NAN;
        broken.color[600] = f32::INFINITY;
        broken.color[900] = 1e30;
        broken.albedo.as_mut().unwrap()[50] = f32::NAN;
        broken.normal.as_mut().unwrap()[70] = f32::NEG_INFINITY;
        let clean = denoiser.denoise(broken).unwrap();
        assert!(clean.iter().all(|v| v.is_finite()));
        assert_eq!(denoiser.denoise(noisy(1, 1)).unwrap().len(), 3);
        assert!(denoiser.denoise(NoisyImage::default()).unwrap().is_empty());
        let short = NoisyImage { width: 33, ..noisy(32, 32) };
        assert!(matches!(denoiser.denoise(short), Err(DenoiseError::Size("albedo"))));
    }
}
