// What the page shows and how it answers to the mouse, the keyboard and its controls.
/* global openImages */
"use strict";
(async () => {
  const $ = (id) => document.getElementById(id);
  const make = (tag, attributes = {}, ...children) => {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name === "class") element.className = value;
      else element.setAttribute(name, value);
    }
    element.append(...children);
    return element;
  };
  const clamp = (v, low, high) => Math.min(Math.max(v, low), high);

  const manifest = JSON.parse($("manifest").textContent);
  const { width, height, images } = manifest;
  const { reference, views, mapOf, highOf, valueAt, surface } = await openImages(manifest);
  const viewOf = (key) => views.find((view) => view.key === key);
  $("loading").remove();

  // ---- State and drawing ----

  const state = {
    mode: images.length > 1 ? "wipe" : "single",
    a: { image: 0, view: "color" },
    b: { image: reference, view: "color" },
    exposure: manifest.exposure,
    wipe: 0.5,
    // Screen pixels per image pixel; null: fit. The image point at the middle of each cell.
    zoom: null,
    center: [width / 2, height / 2],
    pointer: null,
  };
  const canvas = $("canvas");
  const context = canvas.getContext("2d");
  let scheduled = false;
  function redraw() {
    if (!scheduled) {
      scheduled = true;
      requestAnimationFrame(draw);
    }
  }

  // Rectangles of the stage (CSS pixels) and what each shows.
  function cells() {
    const [w, h] = [canvas.clientWidth, canvas.clientHeight];
    if (state.mode !== "grid") return [{ x: 0, y: 0, w, h, image: state.a.image, view: state.a.view }];
    let best = { size: 0, columns: 1 };
    for (let columns = 1; columns <= images.length; columns++) {
      const rows = Math.ceil(images.length / columns);
      const size = Math.min(w / columns / width, h / rows / height);
      if (size > best.size) best = { size, columns };
    }
    const rows = Math.ceil(images.length / best.columns);
    const [cw, ch] = [w / best.columns, h / rows];
    return images.map((_, image) => ({
      x: (image % best.columns) * cw, y: Math.floor(image / best.columns) * ch, w: cw, h: ch, image, view: state.a.view,
    }));
  }
  function zoomOf(cell) {
    if (state.zoom !== null) return state.zoom;
    const margin = state.mode === "grid" ? 8 : 24;
    return Math.max(0.01, Math.min((cell.w - margin) / width, (cell.h - margin) / height));
  }
  // Where the image's first pixel begins, on whole device pixels.
  function originOf(cell) {
    const ratio = window.devicePixelRatio || 1;
    const zoom = zoomOf(cell);
    const snap = (v) => Math.round(v * ratio) / ratio;
    return [snap(cell.x + cell.w / 2 - state.center[0] * zoom), snap(cell.y + cell.h / 2 - state.center[1] * zoom)];
  }

  function drawImage(cell, image, view, from, to) {
    const zoom = zoomOf(cell);
    const [x, y] = originOf(cell);
    context.save();
    context.beginPath();
    context.rect(from, cell.y, to - from, cell.h);
    context.clip();
    context.imageSmoothingEnabled = zoom * (window.devicePixelRatio || 1) < 1;
    context.imageSmoothingQuality = "high";
    const missing = view.values && !mapOf(image, view);
    if (missing) {
      context.fillStyle = "#26262b";
      context.fillRect(x, y, width * zoom, height * zoom);
      context.fillStyle = "#8a8a94";
      context.font = "13px system-ui, sans-serif";
      context.textAlign = "center";
      context.fillText(`${view.title}: none for this image`, (from + to) / 2, cell.y + cell.h / 2);
    } else {
      context.drawImage(surface(image, view, state.exposure), x, y, width * zoom, height * zoom);
    }
    if (state.pointer && state.mode === "grid") {
      const [px, py] = [x + (state.pointer[0] + 0.5) * zoom, y + (state.pointer[1] + 0.5) * zoom];
      context.strokeStyle = "#ffffffa0";
      context.beginPath();
      context.moveTo(px - 7, py);
      context.lineTo(px + 7, py);
      context.moveTo(px, py - 7);
      context.lineTo(px, py + 7);
      context.stroke();
    }
    context.restore();
  }

  function label(cell) {
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "left";
    const key = cell.image === reference ? "0" : String(cell.image + 1);
    const text = `${key}  ${images[cell.image].name}${cell.image === reference ? "  (reference)" : ""}`;
    const y = cell.image === state.a.image && cell.x === 0 && cell.y === 0 ? cell.y + 44 : cell.y + 8;
    context.fillStyle = "#1f1f23d8";
    context.fillRect(cell.x + 10, y, context.measureText(text).width + 14, 22);
    context.fillStyle = "#e6e6ea";
    context.fillText(text, cell.x + 17, y + 15);
  }

  function draw() {
    scheduled = false;
    const ratio = window.devicePixelRatio || 1;
    const [w, h] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(h * ratio);
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = "#121214";
    context.fillRect(0, 0, w, h);
    const all = cells();
    if (state.mode === "wipe") {
      const at = Math.round(state.wipe * w * ratio) / ratio;
      drawImage(all[0], state.a.image, viewOf(state.a.view), 0, at);
      drawImage(all[0], state.b.image, viewOf(state.b.view), at, w);
    } else {
      for (const cell of all) drawImage(cell, cell.image, viewOf(cell.view), cell.x, cell.x + cell.w);
    }
    if (state.mode === "grid") {
      for (const cell of all) {
        context.fillStyle = "#38383f";
        if (cell.x > 0) context.fillRect(cell.x, cell.y, 1, cell.h);
        if (cell.y > 0) context.fillRect(cell.x, cell.y, cell.w, 1);
        label(cell);
      }
    }
    $("zoom").textContent = `${(zoomOf(all[0]) * 100).toFixed(zoomOf(all[0]) < 0.1 ? 1 : 0)} %`;
    $("divider").style.left = `${state.wipe * w}px`;
  }

  // ---- Panels ----

  const short = (v) => {
    if (v === undefined) return "–";
    if (!Number.isFinite(v)) return String(v);
    const a = Math.abs(v);
    return a !== 0 && (a < 1e-3 || a >= 1e5) ? v.toExponential(2) : Number(v.toPrecision(3)).toString();
  };

  function legend(id, side, isShown) {
    const view = viewOf(state[side].view);
    const element = $(id);
    element.hidden = !isShown || !view.values;
    if (element.hidden) return;
    const high = highOf(view);
    const stops = (view.scale === "signed" ? manifest.signed : manifest.heat).map((c) => `rgb(${c})`).join(",");
    const bar = make("div", { class: "bar" });
    bar.style.background = `linear-gradient(to right,${stops})`;
    const ticks = [0, 0.25, 0.5, 0.75, 1].map((t) => make("span", {}, short(valueAt[view.scale](t, high))));
    const button = (text, step, title) => {
      const b = make("button", { title, "aria-label": title }, text);
      b.addEventListener("click", () => changeRange(view, step));
      return b;
    };
    element.replaceChildren(
      make("div", { class: "title" }, view.title,
        make("span", {}, button("−", -1, "Narrower range ([)"), " ", button("+", 1, "Wider range (])"))),
      bar, make("div", { class: "ticks" }, ...ticks));
  }
  function changeRange(view, step) {
    view.range = clamp((view.range || 0) + step, -20, 20);
    update();
  }

  const triple = (v, i) => ["r", "g", "b"].map((c, k) => make("i", { class: c }, ` ${short(v[3 * i + k])}`));
  function readout() {
    const element = $("readout");
    if (!state.pointer) {
      element.replaceChildren(`${width} × ${height} pixels`,
        make("span", {}, "move over the image for values; wheel zooms, drag pans, ? for keys"));
      return;
    }
    const [x, y] = state.pointer;
    const i = y * width + x;
    const entry = (image, view) => {
      const parts = [make("b", {}, images[image].name), ...triple(images[image].values.color, i)];
      const map = view.values && mapOf(image, view);
      if (map) parts.push(`   ${view.title}: ${short(map[i])}`);
      return make("span", {}, ...parts);
    };
    const shown = {
      wipe: () => [["a", state.a.image], ["b", state.b.image]],
      single: () => [["a", state.a.image]],
      grid: () => images.map((_, image) => ["a", image]),
    }[state.mode]();
    element.replaceChildren(make("span", {}, "x ", make("b", {}, String(manifest.x + x)), "  y ", make("b", {}, String(manifest.y + y))),
      ...shown.map(([side, image]) => entry(image, viewOf(state[side].view))));
  }

  // ---- Table ----

  const sorting = { column: null, up: true };
  function bestOf(column) {
    const values = manifest.rows.map((row) => row[column].value).filter((v) => v !== null);
    const better = manifest.columns[column].better;
    if (values.length < 2 || better === "none") return null;
    if (better === "higher") return Math.max(...values);
    return Math.min(...values);
  }
  function metrics() {
    const header = (title, help, column) => {
      const button = make("button", { title: help }, title);
      button.addEventListener("click", () => {
        sorting.up = sorting.column === column ? !sorting.up : true;
        sorting.column = column;
        metrics();
      });
      const th = make("th", { scope: "col" }, button);
      if (sorting.column === column) th.setAttribute("aria-sort", sorting.up ? "ascending" : "descending");
      return th;
    };
    $("metrics").querySelector("thead").replaceChildren(make("tr", {}, header("Image", "in the order of the command line", null),
      ...manifest.columns.map((c, i) => header(c.title, c.help, i))));
    const order = manifest.rows.map((_, i) => i);
    const key = (i) => (sorting.column === null ? i : manifest.rows[i][sorting.column].value ?? Infinity);
    order.sort((p, q) => (key(p) === key(q) ? p - q : (key(p) < key(q) ? -1 : 1) * (sorting.up ? 1 : -1)));
    const best = manifest.columns.map((_, c) => bestOf(c));
    const rows = order.map((i) => {
      const cells = manifest.rows[i].map((cell, c) =>
        make("td", cell.value !== null && cell.value === best[c] ? { class: "best" } : {}, cell.text));
      const layer = images[i].layer === "R G B" ? [] : [make("small", {}, images[i].layer)];
      const row = make("tr", { title: images[i].path }, make("td", {}, images[i].name, ...layer), ...cells);
      row.dataset.image = String(i);
      row.addEventListener("click", () => choose("a", i));
      return row;
    });
    $("metrics").querySelector("tbody").replaceChildren(...rows);
    mark();
  }
  function mark() {
    for (const row of $("metrics").querySelectorAll("tbody tr")) {
      row.classList.toggle("shown", Number(row.dataset.image) === state.a.image);
    }
  }

  // ---- What the controls do ----

  function update() {
    for (const button of $("modes").children) {
      button.setAttribute("role", "radio");
      button.setAttribute("aria-checked", String(button.dataset.mode === state.mode));
    }
    const isWipe = state.mode === "wipe";
    $("divider").hidden = !isWipe;
    $("side-b").hidden = !isWipe;
    $("image-a").hidden = state.mode === "grid";
    for (const side of ["a", "b"]) {
      $(`image-${side}`).value = String(state[side].image);
      $(`view-${side}`).value = state[side].view;
    }
    $("exposure").value = String(state.exposure);
    $("exposure-value").textContent = `${state.exposure < 0 ? "−" : "+"}${Math.abs(state.exposure).toFixed(1)}`;
    $("divider").setAttribute("aria-valuenow", String(Math.round(100 * state.wipe)));
    legend("legend-a", "a", true);
    legend("legend-b", "b", isWipe && state.b.view !== state.a.view);
    mark();
    readout();
    redraw();
  }
  function choose(side, image) {
    if (image >= 0 && image < images.length) {
      state[side].image = image;
      update();
    }
  }
  function nextView(side) {
    const at = views.findIndex((view) => view.key === state[side].view);
    state[side].view = views[(at + 1) % views.length].key;
    update();
  }
  function expose(stops) {
    state.exposure = clamp(stops, -40, 40);
    update();
  }
  function setMode(mode) {
    state.mode = mode;
    update();
  }
  function fit() {
    state.zoom = null;
    state.center = [width / 2, height / 2];
    update();
  }

  const cellAt = (x, y) => cells().find((c) => x >= c.x && x < c.x + c.w && y >= c.y && y < c.y + c.h) || cells()[0];
  function imagePoint(x, y) {
    const cell = cellAt(x, y);
    const [ox, oy] = originOf(cell);
    return [(x - ox) / zoomOf(cell), (y - oy) / zoomOf(cell)];
  }
  // Zooms so that the image point under (x, y) stays there.
  function zoomAt(x, y, factor) {
    const cell = cellAt(x, y);
    const point = imagePoint(x, y);
    state.zoom = clamp(zoomOf(cell) * factor, 0.02, 256);
    state.center = [point[0] - (x - cell.x - cell.w / 2) / state.zoom, point[1] - (y - cell.y - cell.h / 2) / state.zoom];
    update();
  }
  const middle = () => {
    const cell = cells()[0];
    return [cell.x + cell.w / 2, cell.y + cell.h / 2];
  };
  const position = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };

  function drags(element, start, move) {
    let from = null;
    element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      element.setPointerCapture(event.pointerId);
      from = start(event);
    });
    element.addEventListener("pointermove", (event) => from && move(event, from));
    const end = () => {
      from = null;
      element.classList.remove("dragging");
    };
    element.addEventListener("pointerup", end);
    element.addEventListener("pointercancel", end);
  }
  drags(canvas, (event) => {
    canvas.focus();
    canvas.classList.add("dragging");
    const [x, y] = position(event);
    return { x, y, center: state.center, zoom: zoomOf(cellAt(x, y)) };
  }, (event, from) => {
    const [x, y] = position(event);
    state.zoom = from.zoom;
    state.center = [from.center[0] - (x - from.x) / from.zoom, from.center[1] - (y - from.y) / from.zoom];
    redraw();
  });
  drags($("divider"), () => ({}), (event) => {
    state.wipe = clamp(position(event)[0] / canvas.clientWidth, 0, 1);
    $("divider").setAttribute("aria-valuenow", String(Math.round(100 * state.wipe)));
    redraw();
  });
  $("divider").addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
    if (step) {
      event.stopPropagation();
      state.wipe = clamp(state.wipe + step, 0, 1);
      update();
    }
  });

  $("stage").addEventListener("pointermove", (event) => {
    const [x, y] = imagePoint(...position(event)).map(Math.floor);
    state.pointer = x >= 0 && y >= 0 && x < width && y < height ? [x, y] : null;
    readout();
    if (state.mode === "grid") redraw();
  });
  $("stage").addEventListener("pointerleave", () => {
    state.pointer = null;
    readout();
    redraw();
  });
  $("stage").addEventListener("wheel", (event) => {
    event.preventDefault();
    // Lines and pages count as what a wheel of pixels would send.
    const delta = event.deltaY * [1, 33, 400][event.deltaMode];
    zoomAt(...position(event), 2 ** clamp(-delta / 240, -2, 2));
  }, { passive: false });
  canvas.addEventListener("dblclick", fit);

  for (const button of $("modes").children) button.addEventListener("click", () => setMode(button.dataset.mode));
  $("fit").addEventListener("click", fit);
  const actual = () => zoomAt(...middle(), 1 / (window.devicePixelRatio || 1) / zoomOf(cells()[0]));
  $("actual").addEventListener("click", actual);
  $("exposure").addEventListener("input", (event) => expose(Number(event.target.value)));
  $("exposure").addEventListener("dblclick", () => expose(manifest.exposure));
  for (const side of ["a", "b"]) {
    $(`image-${side}`).append(...images.map((image, i) => {
      const text = i === reference ? `0  ${image.name} (reference)` : `${i + 1}  ${image.name}`;
      return make("option", { value: String(i) }, text);
    }));
    $(`view-${side}`).append(...views.map((view) => make("option", { value: view.key }, view.title)));
    $(`image-${side}`).addEventListener("change", (event) => choose(side, Number(event.target.value)));
    $(`view-${side}`).addEventListener("change", (event) => {
      state[side].view = event.target.value;
      update();
    });
  }
  function toggle(id, button) {
    $(id).hidden = !$(id).hidden;
    $(button).setAttribute("aria-expanded", String(!$(id).hidden));
    redraw();
  }
  const toggleTable = () => toggle("metrics", "table-toggle");
  const toggleHelp = () => toggle("help", "help-toggle");
  $("table-toggle").addEventListener("click", toggleTable);
  $("help-toggle").addEventListener("click", toggleHelp);

  const keys = {
    w: () => setMode("wipe"), g: () => setMode("grid"), s: () => setMode("single"),
    f: fit, o: actual, "+": () => zoomAt(...middle(), 2), "=": () => zoomAt(...middle(), 2), "-": () => zoomAt(...middle(), 0.5),
    e: () => expose(state.exposure + 0.5), E: () => expose(state.exposure - 0.5), r: () => expose(manifest.exposure),
    v: () => nextView("a"), V: () => nextView("b"),
    "[": () => changeRange(viewOf(state.a.view), -1), "]": () => changeRange(viewOf(state.a.view), 1),
    x: () => {
      [state.a, state.b] = [state.b, state.a];
      update();
    },
    ArrowLeft: () => choose("a", (state.a.image + images.length - 1) % images.length),
    ArrowRight: () => choose("a", (state.a.image + 1) % images.length),
    t: toggleTable, "?": toggleHelp, Escape: () => !$("help").hidden && toggleHelp(),
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select, input")) return;
    const digit = /^Digit(\d)$/.exec(event.code);
    if (digit) {
      const image = digit[1] === "0" ? reference : Number(digit[1]) - 1;
      if (image < reference || digit[1] === "0") choose(event.shiftKey ? "b" : "a", image);
    } else if (keys[event.key]) {
      keys[event.key]();
    } else {
      return;
    }
    event.preventDefault();
  });
  new ResizeObserver(redraw).observe($("stage"));

  document.title = `${images.slice(0, -1).map((image) => image.name).join(", ")} – Lumiris compare`;
  metrics();
  update();
  canvas.focus({ preventScroll: true });
  document.body.dataset.ready = "true";
})();
