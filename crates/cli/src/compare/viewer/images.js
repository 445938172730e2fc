// The images and everything that is computed from their values: maps, ranges, and pixels for the screen.
/* exported openImages */
"use strict";
const openImages = async (manifest) => {
  const clamp = (v, low, high) => Math.min(Math.max(v, low), high);
  const { width, height, images } = manifest;
  const reference = images.length - 1;

  // The three upper bytes of each f32, sorted by significance, zlib, base64.
  async function unpack(id) {
    const element = document.getElementById(id);
    const text = atob(element.textContent);
    element.remove();
    const packed = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) packed[i] = text.charCodeAt(i);
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const planes = new Uint8Array(await new Response(stream).arrayBuffer());
    const n = planes.length / 3;
    const bits = new Uint32Array(n);
    for (let i = 0; i < n; i++) bits[i] = (planes[i] << 24) | (planes[n + i] << 16) | (planes[2 * n + i] << 8);
    return new Float32Array(bits.buffer);
  }

  for (const [index, image] of images.entries()) {
    image.values = {};
    for (const key of image.data) image.values[key] = await unpack(`data-${index}-${key}`);
  }

  // ---- Views: what can be shown of an image ----

  const luminance = (v, i) => 0.212671 * v[3 * i] + 0.71516 * v[3 * i + 1] + 0.072169 * v[3 * i + 2];
  const perPixel = (f) => (image) => {
    const x = images[image].values.color;
    const r = images[reference].values.color;
    const out = new Float32Array(width * height);
    for (let i = 0; i < out.length; i++) out[i] = f(x, r, i);
    return out;
  };
  const mean3 = (f) => (x, r, i) => (f(x[3 * i], r[3 * i]) + f(x[3 * i + 1], r[3 * i + 1]) + f(x[3 * i + 2], r[3 * i + 2])) / 3;
  const stored = (key) => (image) => images[image].values[key];
  const epsilon = Math.max(manifest.epsilon, 1e-12);
  const views = [
    { key: "color", title: "Colour" },
    { key: "difference", title: "Difference |x − r|", scale: "log", values: perPixel(mean3((x, r) => Math.abs(x - r))) },
    {
      key: "signed", title: "Signed difference", scale: "signed",
      values: perPixel((x, r, i) => luminance(x, i) - luminance(r, i)),
    },
    {
      key: "relative", title: "Relative squared difference", scale: "log",
      values: perPixel(mean3((x, r) => (x - r) ** 2 / (r * r + epsilon))),
    },
    { key: "variance", title: "Variance", scale: "log", values: stored("variance") },
    { key: "flip", title: "FLIP", scale: "linear", high: 1, values: stored("flip") },
    { key: "hdrflip", title: "HDR-FLIP", scale: "linear", high: 1, values: stored("hdrflip") },
    { key: "tvi", title: "Thresholds of vision", scale: "signed", values: stored("tvi") },
    { key: "z", title: "z (standard deviations)", scale: "signed", high: 5, values: stored("z") },
  ].filter((view) => !view.values || !["variance", "flip", "hdrflip", "tvi", "z"].includes(view.key) ||
    images.some((image) => image.data.includes(view.key)));

  const mapCache = new Map();
  function mapOf(image, view) {
    const key = `${image} ${view.key}`;
    if (!mapCache.has(key)) mapCache.set(key, view.values(image));
    return mapCache.get(key);
  }

  // The value that one pixel in a thousand exceeds, of all images together, so that their maps can be compared.
  function highOf(view) {
    if (view.high === undefined) {
      const sample = [];
      const step = Math.max(1, Math.floor((width * height * images.length) / 200000));
      for (let image = 0; image < images.length; image++) {
        const map = mapOf(image, view) || [];
        for (let i = image % step; i < map.length; i += step) {
          const v = Math.abs(map[i]);
          if (v > 0 && v < Infinity) sample.push(v);
        }
      }
      sample.sort((a, b) => a - b);
      view.high = sample[Math.floor(sample.length * 0.999)] || 1;
    }
    return view.high * 2 ** (view.range || 0);
  }

  // ---- Numbers to pixels ----

  const srgb = new Uint8ClampedArray(65536);
  for (let i = 0; i < srgb.length; i++) {
    const v = i / 65535;
    srgb[i] = 255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
  }
  function lookup(stops) {
    const out = new Uint8ClampedArray(256 * 3);
    for (let i = 0; i < 256; i++) {
      const t = (i / 255) * (stops.length - 1);
      const k = Math.min(Math.floor(t), stops.length - 2);
      for (let c = 0; c < 3; c++) out[3 * i + c] = stops[k][c] + (stops[k + 1][c] - stops[k][c]) * (t - k);
    }
    return out;
  }
  const colors = { log: lookup(manifest.heat), linear: lookup(manifest.heat), signed: lookup(manifest.signed) };
  const decades = 4;
  const place = {
    log: (v, high) => (v > 0 ? 1 + Math.log10(v / high) / decades : 0),
    linear: (v, high) => v / high,
    signed: (v, high) => 0.5 + (0.5 * v) / high,
  };
  const valueAt = {
    log: (t, high) => high * 10 ** (decades * (t - 1)),
    linear: (t, high) => t * high,
    signed: (t, high) => (2 * t - 1) * high,
  };
  const odd = [255, 0, 255];

  function paint(image, view, exposure) {
    const imageData = new ImageData(width, height);
    const out = imageData.data;
    const n = width * height;
    if (!view.values) {
      const v = images[image].values.color;
      const gain = 65535 * 2 ** exposure;
      for (let i = 0; i < n; i++) {
        const [r, g, b] = [v[3 * i], v[3 * i + 1], v[3 * i + 2]];
        if (Number.isFinite(r + g + b)) {
          out[4 * i] = srgb[clamp(r * gain + 0.5, 0, 65535) | 0];
          out[4 * i + 1] = srgb[clamp(g * gain + 0.5, 0, 65535) | 0];
          out[4 * i + 2] = srgb[clamp(b * gain + 0.5, 0, 65535) | 0];
        } else {
          out.set(odd, 4 * i);
        }
        out[4 * i + 3] = 255;
      }
      return imageData;
    }
    const map = mapOf(image, view);
    const [lut, at, high] = [colors[view.scale], place[view.scale], highOf(view)];
    for (let i = 0; map && i < n; i++) {
      const t = at(map[i], high);
      if (Number.isNaN(t)) {
        out.set(odd, 4 * i);
      } else {
        const k = 3 * Math.round(255 * clamp(t, 0, 1));
        [out[4 * i], out[4 * i + 1], out[4 * i + 2]] = [lut[k], lut[k + 1], lut[k + 2]];
      }
      out[4 * i + 3] = 255;
    }
    return imageData;
  }

  const surfaces = new Map();
  // A canvas of the size of the images; painted again only where the exposure or the range changed.
  function surface(image, view, exposure) {
    const name = `${image} ${view.key}`;
    const version = view.values ? highOf(view) : exposure;
    let entry = surfaces.get(name);
    surfaces.delete(name);
    if (!entry || entry.version !== version) {
      const canvas = entry ? entry.canvas : Object.assign(document.createElement("canvas"), { width, height });
      canvas.getContext("2d").putImageData(paint(image, view, exposure), 0, 0);
      entry = { canvas, version };
    }
    surfaces.set(name, entry);
    // The least recently used go first.
    if (surfaces.size > Math.max(16, 2 * images.length)) surfaces.delete(surfaces.keys().next().value);
    return entry.canvas;
  }

  return { reference, views, mapOf, highOf, valueAt, surface };
};
