"use strict";
const get = (id) => document.getElementById(id);
const [stage, picture, layerChoice, exposure] = ["stage", "picture", "layer", "exposure"].map(get);
const context = picture.getContext("2d");
// Time between two looks at the renderer (ms)
const INTERVAL = 500;

let state = null;
// Values of the layer that is shown, and the state of the renderer that they are of
let pixels = new Float32Array(0), channels = 3, version = "0";
// Place of the picture in the window: its left upper corner, and the size of a pixel
let view = { x: 0, y: 0, scale: 1, isFitted: true };

const srgb = new Uint8ClampedArray(4097);
for (let i = 0; i <= 4096; i++) {
  const v = i / 4096;
  srgb[i] = Math.round(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055));
}
const encode = (v) => srgb[v >= 1 ? 4096 : v > 0 ? Math.round(v * 4096) : 0];

// What stands for a value on the screen: light by the exposure, directions about grey, numbers by the largest one
function shading() {
  const name = state.layers[layerChoice.value].name;
  if (name === "normal") return (v) => Math.round(127.5 + 127.5 * v);
  if (channels === 3) {
    const gain = 2 ** exposure.value;
    return (v) => encode(v * gain);
  }
  let max = 0;
  for (const v of pixels) if (v > max && v < Infinity) max = v;
  const gain = 2 ** exposure.value / (max || 1);
  return (v) => Math.round(255 * Math.min(1, v * gain));
}

function draw(left, top, width, height) {
  if (width === 0 || height === 0) return;
  const shade = shading(), image = context.createImageData(width, height), out = image.data;
  let to = 0;
  for (let y = top; y < top + height; y++) {
    let from = (y * state.width + left) * channels;
    for (let x = 0; x < width; x++, from += channels, to += 4) {
      for (let c = 0; c < 3; c++) out[to + c] = shade(pixels[from + (channels === 3 ? c : 0)]);
      out[to + 3] = 255;
    }
  }
  context.putImageData(image, left, top);
}
const drawAll = () => state && draw(0, 0, state.width, state.height);

function place() {
  const { clientWidth: w, clientHeight: h } = stage;
  if (view.isFitted && state) {
    view.scale = Math.min(w / state.width, h / state.height);
    view.x = (w - state.width * view.scale) / 2;
    view.y = (h - state.height * view.scale) / 2;
  }
  picture.style.transform = `translate(${view.x}px, ${view.y}px) scale(${view.scale})`;
}

function zoom(factor, x, y) {
  const scale = Math.min(64, Math.max(1 / 16, view.scale * factor));
  view = { x: x - (x - view.x) * scale / view.scale, y: y - (y - view.y) * scale / view.scale, scale, isFitted: false };
  place();
}

function begin(next) {
  const isNew = !state || state.image !== next.image;
  state = next;
  get("summary").textContent = state.summary ?? "";
  if (!isNew) return;
  [picture.width, picture.height] = [state.width, state.height];
  const chosen = layerChoice.selectedOptions[0]?.textContent;
  layerChoice.replaceChildren(...state.layers.map((layer, i) => new Option(layer.name, i, false, layer.name === chosen)));
  get("name").textContent = document.title = state.name;
  reset();
  place();
}

function reset() {
  channels = state.layers[layerChoice.value].channels;
  pixels = new Float32Array(state.width * state.height * channels);
  version = "0";
  drawAll();
}

// Some tiles at a time, until they are those of the last state; false if there is nothing more to fetch
async function fetchSome() {
  const [layer, image] = [layerChoice.value, state.image];
  const answer = await fetch(`tiles?image=${image}&layer=${layer}&since=${version}`);
  if (!answer.ok) return false;
  const data = new DataView(await answer.arrayBuffer());
  // Another image or layer was chosen meanwhile
  if (image !== state.image || layer !== layerChoice.value) return false;
  const rectangles = [];
  for (let at = 8; at < data.byteLength;) {
    const [left, top, width, height] = [0, 4, 8, 12].map((offset) => data.getUint32(at + offset, true));
    at += 16;
    for (let y = top; y < top + height; y++) {
      let to = (y * state.width + left) * channels;
      for (let i = 0; i < width * channels; i++, at += 4) pixels[to++] = data.getFloat32(at, true);
    }
    rectangles.push([left, top, width, height]);
  }
  version = data.getBigUint64(0, true).toString();
  // Numbers are shown by the largest one, which may be new
  if (channels === 1 && rectangles.length > 0) drawAll();
  else rectangles.forEach((rectangle) => draw(...rectangle));
  return rectangles.length > 0 && Number(version) < state.version;
}

async function fetchTiles() {
  while (await fetchSome());
}

const time = (seconds) => {
  const s = Math.max(0, Math.round(seconds));
  return s < 3600 ? `${Math.floor(s / 60)}:${String(s % 60).padStart(2, "0")}` : `${(s / 3600).toFixed(1)} h`;
};

function tell() {
  const share = state.total ? state.done / state.total : 0;
  get("progress").value = state.finished ? 1 : share;
  const left = share > 0 ? state.seconds * (1 / share - 1) : null;
  const words = [
    `${(100 * share).toFixed(1)} %`,
    state.noise === null ? null : `noise ${(100 * state.noise).toFixed(2)} %`,
    `${time(state.seconds)} elapsed`,
    state.finished ? "finished" : left === null ? null : `${time(left)} left`,
  ];
  get("status").textContent = words.filter((word) => word !== null).join(" · ");
}

async function look() {
  try {
    const next = await (await fetch("state")).json();
    if (next.image !== null) {
      begin(next);
      await fetchTiles();
      tell();
    }
  } catch {
    if (state && !state.finished) get("status").textContent = "The renderer does not answer.";
  }
  setTimeout(look, INTERVAL);
}

layerChoice.onchange = () => { reset(); fetchTiles().catch(() => {}); };
exposure.oninput = () => { get("stops").textContent = exposure.value; drawAll(); };
get("fit").onclick = () => { view.isFitted = true; place(); };
get("actual").onclick = () => zoom(1 / view.scale, stage.clientWidth / 2, stage.clientHeight / 2);
addEventListener("keydown", (event) => {
  const button = { 0: "fit", 1: "actual" }[event.key];
  if (button && event.target.tagName !== "SELECT") get(button).click();
});
addEventListener("resize", place);
stage.addEventListener("wheel", (event) => {
  const { left, top } = stage.getBoundingClientRect();
  zoom(2 ** (-event.deltaY / 240), event.clientX - left, event.clientY - top);
  event.preventDefault();
}, { passive: false });
stage.addEventListener("pointermove", (event) => {
  if (event.buttons & 1) {
    view = { ...view, x: view.x + event.movementX, y: view.y + event.movementY, isFitted: false };
    place();
  }
  const { left, top } = stage.getBoundingClientRect();
  const x = Math.floor((event.clientX - left - view.x) / view.scale);
  const y = Math.floor((event.clientY - top - view.y) / view.scale);
  const isInside = state && x >= 0 && y >= 0 && x < state.width && y < state.height;
  const values = isInside ? [...pixels.subarray((y * state.width + x) * channels).subarray(0, channels)] : [];
  get("value").textContent = isInside ? `${x}, ${y}: ${values.map((v) => v.toPrecision(4)).join("  ")}` : "";
});
look();
