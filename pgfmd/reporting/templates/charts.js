"use strict";
/* Charts as SVG: zoom by dragging, buttons and keys, a reading of the nearest point, curves switched off and on. */
const SVG = "http://www.w3.org/2000/svg";

function node(name, attributes, parent, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
}

function short(value) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e5 || size < 1e-3 ? value.toExponential(2) : String(Number(value.toPrecision(5)));
  return text.replace(/^-/, "\u2212");
}

function ticksOf(low, high, most) {
  const rough = (high - low) / Math.max(most, 1), power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((each) => each >= rough * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
    found.push([k * step, short(Number((k * step).toPrecision(12)))]);
    if (found.length > 40) break;
  }
  return found;
}

class Chart {
  constructor(figure, data) {
    this.data = data;
    this.plot = figure.querySelector(".plot");
    this.readout = figure.querySelector(".readout");
    this.hidden = new Set();
    this.mark = null;
    this.width = 0;
    this.view = this.whole();
    this.fillLegend(figure.querySelector(".legend"));
    for (const button of figure.querySelectorAll(".tools button"))
      button.addEventListener("click", () => this.act(button.dataset.do));
    this.listen();
    new ResizeObserver(() => this.resize(this.plot.clientWidth)).observe(this.plot);
    this.resize(this.plot.clientWidth);
  }

  resize(width) {
    if (!width || width === this.width) return;
    this.width = width;
    this.draw();
  }

  whole() {
    let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
    this.data.series.forEach((one, number) => {
      if (this.hidden.has(number)) return;
      one.x.forEach((x, k) => {
        const y = one.y[k], spread = (one.spread && one.spread[k]) || 0;
        if (x === null || y === null) return;
        left = Math.min(left, x); right = Math.max(right, x);
        low = Math.min(low, y - spread); high = Math.max(high, y + spread);
      });
    });
    if (left > right) [left, right, low, high] = [0, 1, 0, 1];
    const wide = (right - left || Math.abs(left) || 1) * 0.03, tall = (high - low || Math.abs(low) || 1) * 0.06;
    return {left: left - wide, right: right + wide, low: low - tall, high: high + tall};
  }

  replace(data) {
    const all = JSON.stringify(this.view) === JSON.stringify(this.whole());
    this.data = data;
    if (all) this.view = this.whole();
    this.draw();
  }

  fillLegend(legend) {
    legend.replaceChildren();
    if (this.data.series.length < 2 && !this.data.marks.length) return;
    this.data.series.forEach((one, number) => {
      const button = document.createElement("button");
      button.type = "button";
      button.setAttribute("aria-pressed", "true");
      const sample = node("svg", {width: 26, height: 10, "aria-hidden": "true"}, button);
      if (one.line === "dots") node("circle", {cx: 13, cy: 5, r: 2.5, style: `fill:var(--c${one.colour})`}, sample);
      else node("path", {d: "M1 5H25", style: this.look(one)}, sample);
      button.append(one.name);
      button.addEventListener("click", () => {
        if (!this.hidden.delete(number)) this.hidden.add(number);
        button.setAttribute("aria-pressed", String(!this.hidden.has(number)));
        this.draw();
      });
      legend.append(button);
    });
  }

  look(one) {
    return `stroke:var(--c${one.colour});fill:none;stroke-width:1.8;stroke-dasharray:${one.line || "none"}`;
  }

  act(what) {
    const {left, right, low, high} = this.view, wide = right - left, tall = high - low;
    const shift = {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1]}[what];
    if (what === "all") this.view = this.whole();
    else if (shift)
      this.view = {left: left + shift[0] * wide, right: right + shift[0] * wide,
                   low: low + shift[1] * tall, high: high + shift[1] * tall};
    else {
      const by = what === "in" ? -0.15 : 0.2;
      this.view = {left: left - by * wide, right: right + by * wide, low: low - by * tall, high: high + by * tall};
    }
    this.draw();
  }

  listen() {
    const plot = this.plot;
    let from = null;
    const place = (event) => {
      const box = plot.getBoundingClientRect(), scale = this.width / box.width;
      return [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
    };
    plot.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "touch" || event.button) return;
      from = place(event);
      plot.setPointerCapture(event.pointerId);
    });
    plot.addEventListener("pointermove", (event) => {
      const at = place(event);
      if (from) this.stretch(from, at); else this.read(at);
    });
    plot.addEventListener("pointerup", (event) => {
      if (!from) return this.read(place(event));
      const [x0, y0] = from, [x1, y1] = place(event);
      from = null;
      if (Math.abs(x1 - x0) > 6 && Math.abs(y1 - y0) > 6) {
        const [left, right] = [x0, x1].sort((a, b) => a - b).map((x) => this.backX(x));
        const [high, low] = [y0, y1].sort((a, b) => a - b).map((y) => this.backY(y));
        this.view = {left, right, low, high};
      }
      this.draw();
    });
    plot.addEventListener("pointercancel", () => { from = null; this.draw(); });
    plot.addEventListener("pointerleave", () => { if (!from) this.point = null, this.placeRing(); });
    plot.addEventListener("dblclick", () => this.act("all"));
    plot.addEventListener("keydown", (event) => {
      const what = {"+": "in", "=": "in", "-": "out", "0": "all"}[event.key] || event.key;
      if (event.ctrlKey || event.metaKey || !/^(in|out|all|Arrow)/.test(what)) return;
      event.preventDefault();
      this.act(what);
    });
  }

  atX(x) { const {left, right} = this.view; return this.box.x + (x - left) / (right - left) * this.box.w; }
  atY(y) { const {low, high} = this.view; return this.box.y + (high - y) / (high - low) * this.box.h; }
  backX(x) { const {left, right} = this.view; return left + (x - this.box.x) / this.box.w * (right - left); }
  backY(y) { const {low, high} = this.view; return high - (y - this.box.y) / this.box.h * (high - low); }

  draw() {
    if (!this.width) return;
    const height = Math.round(Math.min(Math.max(0.5 * this.width, 230), 430));
    const rows = ticksOf(this.view.low, this.view.high, height / 55);
    const room = 34 + 7.2 * Math.max(...rows.map((tick) => tick[1].length), 2);
    this.box = {x: room, y: 12, w: this.width - room - 12, h: height - 58};
    const {x, y, w, h} = this.box;
    const svg = node("svg", {viewBox: `0 0 ${this.width} ${height}`, "font-size": 13, style: "fill:var(--soft)"});
    const id = `clip-${this.data.key}`;
    node("rect", {x, y, width: w, height: h}, node("clipPath", {id}, svg));
    for (const [value, text] of ticksOf(this.view.left, this.view.right, w / 90)) {
      const at = this.atX(value);
      node("path", {d: `M${at} ${y}V${y + h}`, style: "stroke:var(--line)"}, svg);
      node("text", {x: at, y: y + h + 18, "text-anchor": "middle"}, svg, text);
    }
    for (const [value, text] of rows) {
      const at = this.atY(value), style = `stroke:var(${Math.abs(value) < 1e-12 ? "--soft" : "--line"})`;
      node("path", {d: `M${x} ${at}H${x + w}`, style}, svg);
      node("text", {x: x - 7, y: at + 4, "text-anchor": "end"}, svg, text);
    }
    node("text", {x: x + w / 2, y: height - 6, "text-anchor": "middle", style: "fill:var(--ink)"}, svg, this.data.x);
    const turned = {transform: `translate(14 ${y + h / 2}) rotate(-90)`, "text-anchor": "middle", style: "fill:var(--ink)"};
    node("text", turned, svg, this.data.y);
    const inside = node("g", {"clip-path": `url(#${id})`}, svg);
    this.data.series.forEach((one, number) => { if (!this.hidden.has(number)) this.drawSeries(one, inside); });
    this.drawMarks(inside);
    this.ring = node("circle", {r: 6, style: "fill:none;stroke:var(--ink);stroke-width:1.5"}, inside);
    this.slide = node("circle", {r: 7, class: "slide", style: "fill:none;stroke:var(--c1);stroke-width:2.5"}, inside);
    this.band = node("rect", {style: "fill:var(--c0);fill-opacity:0.15;stroke:var(--c0)"}, svg);
    this.plot.replaceChildren(svg);
    this.point = null;
    this.placeRing();
    this.placeSlide();
  }

  drawSeries(one, parent) {
    let path = "", pen = "M";
    const dots = one.line === "dots" || one.spread ? node("g", {style: `fill:var(--c${one.colour})`}, parent) : null;
    one.x.forEach((x, k) => {
      if (x === null || one.y[k] === null) { pen = "M"; return; }
      const at = this.atX(x).toFixed(1), up = this.atY(one.y[k]).toFixed(1);
      if (dots) node("circle", {cx: at, cy: up, r: one.spread ? 3.5 : 1.6}, dots);
      if (one.line !== "dots") { path += pen + at + " " + up; pen = "L"; }
      const spread = one.spread && one.spread[k];
      if (spread) {
        const top = this.atY(one.y[k] + spread).toFixed(1), foot = this.atY(one.y[k] - spread).toFixed(1);
        node("path", {d: `M${at} ${top}V${foot}m-4 0h8M${at - 4} ${top}h8`, style: this.look({colour: one.colour})}, parent);
      }
    });
    if (path) node("path", {d: path, style: this.look(one), "stroke-linejoin": "round"}, parent);
  }

  drawMarks(parent) {
    this.data.marks.forEach((mark, number) => {
      const x = this.atX(mark.x), y = this.atY(mark.y), end = x > this.box.x + this.box.w * 0.8;
      node("path", {d: `M${x} ${y - 5}l5 5l-5 5l-5 -5z`, style: "fill:var(--c1)"}, parent);
      const where = {x: x + (end ? -9 : 9), y: y + (number % 2 ? 18 : -7), "text-anchor": end ? "end" : "start"};
      node("text", {...where, style: "fill:var(--ink);paint-order:stroke;stroke:var(--paper);stroke-width:3"}, parent, mark.text);
    });
  }

  stretch([x0, y0], [x1, y1]) {
    const box = {x: Math.min(x0, x1), y: Math.min(y0, y1), width: Math.abs(x1 - x0), height: Math.abs(y1 - y0)};
    for (const [key, value] of Object.entries(box)) this.band.setAttribute(key, value);
  }

  read([x, y]) {
    let best = 1600, found = null;
    this.data.series.forEach((one, number) => {
      if (this.hidden.has(number)) return;
      one.x.forEach((at, k) => {
        if (at === null || one.y[k] === null) return;
        const far = (this.atX(at) - x) ** 2 + (this.atY(one.y[k]) - y) ** 2;
        if (far < best) { best = far; found = {name: one.name, x: at, y: one.y[k], spread: one.spread && one.spread[k]}; }
      });
    });
    this.point = found;
    this.placeRing();
  }

  placeRing() {
    const found = this.point;
    this.ring.style.display = found ? "" : "none";
    this.readout.textContent = "\u00a0";
    if (!found) return;
    this.ring.setAttribute("cx", this.atX(found.x));
    this.ring.setAttribute("cy", this.atY(found.y));
    const worded = (label, value, spread) => {
      const unit = /^(.*) \((.*)\)$/.exec(label);
      const number = short(value) + (spread ? ` ± ${short(Number(spread.toPrecision(2)))}` : "");
      return unit ? `${unit[1]} ${number} ${unit[2]}` : `${label} ${number}`;
    };
    const y = worded(this.data.y, found.y, found.spread);
    this.readout.textContent = `${found.name}: ${worded(this.data.x, found.x)}, ${y}`;
  }

  placeSlide() {
    this.slide.style.display = this.mark ? "" : "none";
    if (!this.mark) return;
    this.slide.setAttribute("cx", this.atX(this.mark[0]));
    this.slide.setAttribute("cy", this.atY(this.mark[1]));
  }
}
