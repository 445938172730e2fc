//! Loads files as images of a common size.
//!
//! Values are linear Rec.709 radiance; 8-bit and 16-bit files are decoded by the sRGB curve. The display windows must
//! have the same size. The comparison covers the rectangle in which all images have pixels, so a crop can be compared
//! with a whole reference.

use crate::imaging::color_layers::{choose, remark};
use crate::imaging::metrics::Pixel;
use crate::imaging::metrics::flip::MAX_PIXELS;
use crate::imaging::oiio::{ReadImage, ReadLimits, Window, read_headers, read_part};
use std::path::{Path, PathBuf};

/// A rectangle of pixels in the display window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// First column.
    pub x: usize,
    /// First row from the top.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Region {
    fn intersection(self, other: Region) -> Region {
        let (x, y) = (self.x.max(other.x), self.y.max(other.y));
        let end = |a: usize, n: usize, b: usize, m: usize| (a + n).min(b + m);
        Region {
            x,
            y,
            width: end(self.x, self.width, other.x, other.width).saturating_sub(x),
            height: end(self.y, self.height, other.y, other.height).saturating_sub(y),
        }
    }

    /// Columns and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }
}

/// An image cut to the compared region.
#[derive(Clone, Debug)]
pub struct Shown {
    /// The file.
    pub path: PathBuf,
    /// The file name, or the path if another file has the same name.
    pub name: String,
    /// Name of the layer that was read as colour.
    pub layer: String,
    /// Remarks for the user on the choice of channels.
    pub remarks: Vec<String>,
    /// Linear colour, row-major from the top left.
    pub pixels: Vec<Pixel>,
    /// Variance of each pixel mean.
    pub variance: Option<Vec<Pixel>>,
    /// True if the file stores 16-bit floats.
    pub is_half: bool,
}

/// Images of the same size and their reference.
#[derive(Clone, Debug)]
pub struct ImageSet {
    /// Images in the order of the command line.
    pub images: Vec<Shown>,
    /// The reference.
    pub reference: Shown,
    /// The compared region.
    pub region: Region,
    /// Columns and rows of the display windows.
    pub display: [usize; 2],
}

/// All errors that prevent the comparison, one per line.
#[derive(Debug, thiserror::Error)]
#[error("{}", .0.join("\n"))]
pub struct LoadError(pub Vec<String>);

/// An image as read, before it is cut.
#[derive(Clone, Debug)]
pub struct Raw {
    shown: Shown,
    region: Region,
    display: [usize; 2],
}

/// Reads images and their reference, and reports all errors at once. `layer` selects a layer instead of the image.
pub fn load(images: &[PathBuf], reference: &Path, layer: Option<&str>) -> Result<ImageSet, LoadError> {
    let all = images.iter().map(PathBuf::as_path).chain([reference]);
    let (mut raws, mut errors) = (Vec::new(), Vec::new());
    for path in all {
        match read(path, layer) {
            Ok(raw) => raws.push(raw),
            Err(error) if errors.contains(&error) => {}
            Err(error) => errors.push(error),
        }
    }
    let Some(truth) = raws.pop().filter(|_| errors.is_empty()) else { return Err(LoadError(errors)) };
    ImageSet::new(raws, truth)
}

impl ImageSet {
    /// Cuts the images to the region that all have. Reports all errors at once.
    pub fn new(raws: Vec<Raw>, truth: Raw) -> Result<ImageSet, LoadError> {
        // Check sizes and regions
        let mut errors = Vec::new();
        errors.extend(raws.iter().filter(|r| r.display != truth.display).map(|r| {
            let of = |raw: &Raw| format!("{} is {}×{}", raw.shown.path.display(), raw.display[0], raw.display[1]);
            format!("{} and the reference {}: only images of one size can be compared", of(r), of(&truth))
        }));
        let region = raws.iter().fold(truth.region, |region, r| region.intersection(r.region));
        if errors.is_empty() && region.width * region.height == 0 {
            errors.push("there is no pixel that all images have: their data windows do not overlap".to_owned());
        }
        if !errors.is_empty() {
            return Err(LoadError(errors));
        }

        // Cut to the common region
        let display = truth.display;
        let cut = |raw: Raw| raw.cut(region);
        let mut images: Vec<Shown> = raws.into_iter().map(cut).collect();
        let mut reference = truth.cut(region);
        name(images.iter_mut().chain([&mut reference]).collect());
        Ok(ImageSet { images, reference, region, display })
    }
}

/// Sets the names of images: the file names, or the paths where file names are equal.
fn name(mut all: Vec<&mut Shown>) {
    let short = |path: &Path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let names: Vec<String> = all.iter().map(|s| short(&s.path)).collect();
    for (shown, name) in all.iter_mut().zip(&names) {
        let unique = names.iter().filter(|n| *n == name).count() == 1;
        shown.name = if unique { name.clone() } else { shown.path.display().to_string() };
    }
}

/// Reads the colours of a file, or the given layer.
pub fn read(path: &Path, layer: Option<&str>) -> Result<Raw, String> {
    let headers = read_headers(path).map_err(|e| e.to_string())?;
    let chosen = choose(&headers, layer).map_err(|reason| format!("{}: {reason}", path.display()))?;
    let read = read_part(path, chosen.part, &ReadLimits::default()).map_err(|e| e.to_string())?;
    if read.image.width.saturating_mul(read.image.height) > MAX_PIXELS {
        return Err(format!("{}: has more than {MAX_PIXELS} pixels", path.display()));
    }
    let (region, display) = visible(&read.window, [read.image.width, read.image.height]);
    let remarks = remark(&headers, &chosen).into_iter().collect();
    let variance = if chosen.name.is_empty() { variance(&read) } else { None };
    let encoding = read.encoding;
    let pixels =
        pixels(&read, chosen.channels.as_slice()).into_iter().map(|p| p.map(|v| encoding.to_linear(v))).collect();
    let layer = chosen.title().to_owned();
    let shown =
        Shown { path: path.to_owned(), name: String::new(), layer, remarks, pixels, variance, is_half: read.is_half };
    // Cut to the display window
    let whole = Region { x: 0, y: 0, width: read.image.width, height: read.image.height };
    let offset: [i64; 2] =
        std::array::from_fn(|a| i64::from(read.window.origin[a]) - i64::from(read.window.full_origin[a]));
    let inside = Region {
        x: (region.x as i64 - offset[0]).max(0) as usize,
        y: (region.y as i64 - offset[1]).max(0) as usize,
        ..region
    };
    Ok(Raw { shown: shown.cut(whole, inside), region, display })
}

/// The intersection of data window and display window, in coordinates of the display window, and the size of the
/// display window.
fn visible(window: &Window, size: [usize; 2]) -> (Region, [usize; 2]) {
    let full = if window.full_size.contains(&0) { size } else { window.full_size };
    let span = |a: usize| {
        let start = i64::from(window.origin[a]) - i64::from(window.full_origin[a]);
        let end = (start + size[a] as i64).clamp(0, full[a] as i64);
        let start = start.clamp(0, full[a] as i64);
        (start as usize, (end - start).max(0) as usize)
    };
    let ((x, width), (y, height)) = (span(0), span(1));
    (Region { x, y, width, height }, full)
}

/// Colours from one or three channels.
fn pixels(read: &ReadImage, positions: &[usize]) -> Vec<Pixel> {
    let at = |c: usize| positions[c.min(positions.len() - 1)];
    let stride = read.image.channels.len();
    read.image.data.chunks_exact(stride).map(|p| [p[at(0)], p[at(1)], p[at(2)]]).collect()
}

/// Variances of the pixel means, as written by Lumiris. `None` if they are all zero, as with one sample per pixel.
fn variance(read: &ReadImage) -> Option<Vec<Pixel>> {
    let position = |name: &str| read.image.channel(name);
    let positions = [position("variance.R")?, position("variance.G")?, position("variance.B")?];
    let variance = pixels(read, &positions);
    variance.iter().flatten().any(|v| *v > 0.0).then_some(variance)
}

/// The pixels of `part`, where `pixels` covers `whole`.
fn rows(pixels: &[Pixel], whole: Region, part: Region) -> Vec<Pixel> {
    let first = |row: usize| (part.y - whole.y + row) * whole.width + part.x - whole.x;
    (0..part.height).flat_map(|row| &pixels[first(row)..first(row) + part.width]).copied().collect()
}

impl Shown {
    /// Cuts to `part`; the image covers `whole`.
    fn cut(mut self, whole: Region, part: Region) -> Shown {
        if whole == part {
            return self;
        }
        self.pixels = rows(&self.pixels, whole, part);
        self.variance = self.variance.as_deref().map(|v| rows(v, whole, part));
        self
    }
}

impl Raw {
    /// An image in memory. `window` is its position in a larger image, `variance` the variance of its pixel means.
    pub fn of_pixels(
        name: &str,
        window: &Window,
        width: usize,
        pixels: Vec<Pixel>,
        variance: Option<Vec<Pixel>>,
    ) -> Raw {
        let (region, display) = visible(window, [width, pixels.len() / width.max(1)]);
        let shown = Shown {
            path: PathBuf::from(name),
            name: name.to_owned(),
            layer: String::new(),
            remarks: Vec::new(),
            pixels,
            variance,
            is_half: false,
        };
        Raw { shown, region, display }
    }

    fn cut(self, region: Region) -> Shown {
        self.shown.cut(self.region, region)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imaging::oiio::{Part, write_image};

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|&n| n.to_owned()).collect()
    }

    fn rgb() -> Vec<String> {
        names(&["R", "G", "B"])
    }

    /// Pixel values 1000·x + y, in display coordinates.
    fn crop(x: usize, y: usize, width: usize, height: usize) -> Part {
        let value = |i: usize| (1000 * (x + i / 3 % width) + y + i / 3 / width) as f32;
        Part::linear(width, height, rgb(), (0..width * height * 3).map(value).collect()).with_window([x, y], [20, 10])
    }

    #[test]
    fn crops_are_compared_where_all_have_pixels() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        write_image(&path("a.exr"), &[crop(2, 1, 9, 8)]).unwrap();
        write_image(&path("b.exr"), &[crop(5, 0, 15, 6)]).unwrap();
        write_image(&path("r.exr"), &[crop(0, 0, 20, 10)]).unwrap();
        let set = load(&[path("a.exr"), path("b.exr")], &path("r.exr"), None).unwrap();
        assert_eq!(set.region, Region { x: 5, y: 1, width: 6, height: 5 });
        assert_eq!(set.display, [20, 10]);
        for shown in set.images.iter().chain([&set.reference]) {
            assert_eq!(shown.pixels.len(), 30);
            assert_eq!((shown.pixels[0], shown.pixels[29]), ([5001.0; 3], [10005.0; 3]), "{}", shown.name);
        }
        write_image(&path("c.exr"), &[crop(15, 7, 5, 3)]).unwrap();
        let error = load(&[path("a.exr"), path("c.exr")], &path("r.exr"), None).unwrap_err();
        assert!(error.to_string().contains("do not overlap"), "{error}");
    }

    #[test]
    fn data_beyond_the_display_is_cut_off() {
        let window = |x, y, full| Window { origin: [x, y], full_origin: [1, 1], full_size: full };
        let (region, display) = visible(&window(-3, 1, [10, 6]), [20, 4]);
        assert_eq!((region, display), (Region { x: 0, y: 0, width: 10, height: 4 }, [10, 6]));
        assert_eq!(visible(&window(40, 0, [10, 6]), [5, 5]).0.width, 0);
        assert_eq!(visible(&window(0, 0, [0, 0]), [5, 4]).1, [5, 4]);
    }

    #[test]
    fn all_bad_files_and_sizes_are_said_at_once() {
        // Missing and damaged files
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("broken.exr"), b"not an image").unwrap();
        write_image(&path("a.exr"), &[crop(0, 0, 20, 10)]).unwrap();
        let lines = |error: LoadError| error.0;
        let bad =
            lines(load(&[path("no.exr"), path("broken.exr"), path("a.exr")], &path("nor.exr"), None).unwrap_err());
        assert_eq!(bad.len(), 3, "{bad:?}");
        assert!(bad[0].contains("no.exr: no such file") && bad[1].contains("broken.exr") && bad[2].contains("nor.exr"));

        let small = |w: usize, h: usize| Part::linear(w, h, rgb(), vec![0.5; w * h * 3]);
        write_image(&path("b.exr"), &[small(7, 5)]).unwrap();
        write_image(&path("c.exr"), &[small(20, 9)]).unwrap();
        let bad = lines(load(&[path("b.exr"), path("a.exr"), path("c.exr")], &path("a.exr"), None).unwrap_err());
        assert_eq!(bad.len(), 2, "{bad:?}");
        assert!(bad[0].contains("b.exr is 7×5 and the reference") && bad[0].contains("a.exr is 20×10"), "{bad:?}");
        let bad = lines(load(&[path("a.exr")], &path("a.exr"), Some("albedo")).unwrap_err());
        assert!(bad.len() == 1 && bad[0].contains("no layer `albedo`; it has R G B"), "{bad:?}");
    }

    #[test]
    fn variances_are_read_beside_plain_colour_unless_they_are_all_zero() {
        let folder = tempfile::tempdir().unwrap();
        let channels = || names(&["R", "G", "B", "variance.R", "variance.G", "variance.B"]);
        let (a, b) = (folder.path().join("a.exr"), folder.path().join("b.exr"));
        write_image(&a, &[Part::linear(1, 1, channels(), vec![1.0, 2.0, 3.0, 0.1, 0.2, 0.0])]).unwrap();
        write_image(&b, &[Part::linear(1, 1, channels(), vec![1.0, 2.0, 3.0, 0.0, 0.0, 0.0])]).unwrap();
        let set = load(std::slice::from_ref(&a), &b, None).unwrap();
        assert_eq!(set.images[0].variance, Some(vec![[0.1, 0.2, 0.0]]));
        assert_eq!((set.images[0].pixels[0], set.reference.variance), ([1.0, 2.0, 3.0], None));
        let set = load(std::slice::from_ref(&a), &a, Some("variance")).unwrap();
        assert_eq!((set.images[0].pixels[0], &set.images[0].variance), ([0.1, 0.2, 0.0], &None));
        assert_eq!(set.images[0].name, a.display().to_string(), "two of one name are told apart by their paths");
    }
}
