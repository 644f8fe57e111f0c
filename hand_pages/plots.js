"use strict";
/* Draws every figure of the class plot from the JSON inside it (hand_pages/plots.py) as SVG: panels over one axis, zoomed
   together with all plots of the same group. Drag or +, - zoom; arrow keys move; 0, Escape or a double click show all. */
(() => {
const NS = "http://www.w3.org/2000/svg", LEFT = 58, RIGHT = 14, GAP = 12, FOOT = 34, TALL = 56;
const plots = [];
const element = (parent, name, attributes = {}, text = "") => {
  const made = document.createElementNS(NS, name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  if (text) made.textContent = text;
  parent.append(made);
  return made;
};
/* Values of a series: a list, or 16-bit integers in base 64 with a scale; null is a gap. */
const values = (packed) => {
  if (Array.isArray(packed)) return packed;
  const bytes = Uint8Array.from(atob(packed.int16), (c) => c.charCodeAt(0)), whole = new DataView(bytes.buffer);
  return Array.from({length: bytes.length / 2}, (_, k) => {
    const count = whole.getInt16(2 * k, true);
    return count === -32768 ? null : packed.offset + packed.scale * count;
  });
};
/* Round values from low to high, about as many as wanted and at least two where that is possible. */
const ticks = (low, high, wanted) => {
  const raw = (high - low) / Math.max(wanted, 1), power = 10 ** Math.floor(Math.log10(raw));
  const steps = [0.5, 1, 2, 5, 10].map((m) => m * power), last = steps.findIndex((each) => each >= raw * 0.999 && each >= power);
  for (let use = last; ; use--) {
    const step = steps[use], list = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) list.push(k * step);
    if (list.length > 1 || use === 0) return [list, step];
  }
};
const label = (value, step) => {
  if (Math.abs(value) < step * 1e-6) return "0";
  const size = Math.max(Math.abs(value), step);
  if (size >= 1e5 || step < 1e-4) return value.toExponential(Math.max(0, Math.floor(Math.log10(size / step) + 1e-9)));
  return value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
};
const first = (xs, x) => { let a = 0, b = xs.length; while (a < b) { const m = (a + b) >> 1; xs[m] < x ? a = m + 1 : b = m; } return a; };

/* A curve with at most four points a pixel column: first, least, largest, last. */
function path(xs, ys, view, toX, toY) {
  const from = Math.max(first(xs, view[0]) - 1, 0), to = Math.min(first(xs, view[1]) + 1, xs.length), out = [];
  let pen = false;
  const add = (k) => {
    if (ys[k] === null) { pen = false; return; }
    out.push((pen ? "L" : "M") + toX(xs[k]).toFixed(1) + " " + toY(ys[k]).toFixed(1));
    pen = true;
  };
  for (let k = from; k < to;) {
    const column = Math.round(toX(xs[k]));
    let end = k, low = k, high = k;
    while (end + 1 < to && ys[end + 1] !== null && ys[k] !== null && Math.round(toX(xs[end + 1])) === column) {
      end++;
      if (ys[end] < ys[low]) low = end;
      if (ys[end] > ys[high]) high = end;
    }
    [...new Set([k, ...[low, high].sort((a, b) => a - b), end])].forEach(add);
    k = end + 1;
  }
  return out.join("");
}

class Plot {
  constructor(figure, number) {
    this.figure = figure;
    this.number = number;
    this.data = JSON.parse(figure.querySelector("script").textContent);
    this.series = this.data.panels.flatMap((panel) => panel.series);
    for (const one of this.series) {
      one.y = values(one.y);
      const axis = this.data.axes[one.axis];
      one.x = Array.isArray(axis) ? axis : one.y.map((_, k) => axis.start + axis.step * k);
      for (const end of ["low", "high"]) if (one[end]) one[end] = values(one[end]);
      one.all = [one.y, ...(one.variants || []).map(values)];
      one.shown = true;
    }
    const all = this.series.flatMap((one) => [one.x[0], one.x[one.x.length - 1]]);
    this.whole = [Math.min(...all), Math.max(...all)];
    const linked = plots.find((other) => this.data.group && other.data.group === this.data.group);
    this.view = [...(linked ? linked.view : this.whole)];
    this.off = 0;
    this.keys();
    this.switches();
    this.svg = element(figure, "svg", {"aria-hidden": "true"});
    figure.insertBefore(this.svg, figure.querySelector("figcaption"));
    this.readout = document.createElement("output");
    figure.insertBefore(this.readout, figure.querySelector("figcaption"));
    this.listen();
    this.draw();
  }
  keys() {
    const row = document.createElement("div");
    row.className = "keys";
    for (const name of [...new Set(this.series.map((one) => one.name))]) {
      const button = document.createElement("button"), same = this.series.filter((one) => one.name === name);
      const sample = element(button, "svg", {width: 26, height: 10, style: "display:inline;width:26px;margin-right:.3rem", "aria-hidden": "true"});
      element(sample, "path", {class: `curve ${same[0].kind}`, d: "M1 5L25 5"});
      button.append(name);
      button.setAttribute("aria-pressed", "true");
      button.onclick = () => {
        for (const one of same) one.shown = !one.shown;
        button.setAttribute("aria-pressed", String(same[0].shown));
        this.draw();
      };
      row.append(button);
    }
    const all = document.createElement("button");
    all.className = "tool";
    all.textContent = "show all";
    all.onclick = () => this.zoom(this.whole);
    row.append(all);
    this.figure.prepend(row);
  }
  /* Switches of effects: each changes the curves that have variants, and those that follow from them. */
  switches() {
    if (!this.data.switches.length) return;
    const row = document.createElement("div"), note = document.createElement("output");
    row.className = "keys switches";
    row.setAttribute("role", "group");
    row.setAttribute("aria-label", "effects in the model");
    row.append("In the model:");
    this.data.switches.forEach((name, k) => {
      const button = document.createElement("button");
      button.append(name);
      button.setAttribute("aria-pressed", "true");
      button.onclick = () => {
        this.off ^= 1 << k;
        button.setAttribute("aria-pressed", String(!(this.off >> k & 1)));
        note.textContent = this.data.notes[this.off];
        this.switched();
      };
      row.append(button);
    });
    note.textContent = this.data.notes[0];
    this.figure.querySelector(".keys").after(row, note);
  }
  switched() {
    const measured = this.series[0].all[0];
    for (const one of this.series.filter((each) => each.all.length > 1)) {
      one.y = one.all[this.off];
      for (const other of this.series.filter((each) => each.name === one.name && each.all.length === 1))
        other.y = this.off ? one.y.map((left, k) => left === null || measured[k] === null ? null : measured[k] - left) : other.all[0];
    }
    this.draw();
  }
  zoom(view) {
    const least = (this.whole[1] - this.whole[0]) * 1e-4, width = Math.max(view[1] - view[0], least);
    const start = Math.min(Math.max(view[0], this.whole[0]), Math.max(this.whole[1] - width, this.whole[0]));
    const next = [start, Math.min(start + width, this.whole[1])];
    const linked = (other) => other === this || (this.data.group && other.data.group === this.data.group);
    for (const other of plots.filter(linked)) { other.view = [...next]; other.draw(); }
  }
  toX(x) { return LEFT + (x - this.view[0]) / (this.view[1] - this.view[0]) * (this.width - LEFT - RIGHT); }
  fromX(pixel) { return this.view[0] + (pixel - LEFT) / (this.width - LEFT - RIGHT) * (this.view[1] - this.view[0]); }
  range(panel) {
    let low = Infinity, high = -Infinity;
    const take = (v) => { if (v !== null) { low = Math.min(low, v); high = Math.max(high, v); } };
    for (const one of panel.series.filter((each) => each.shown)) {
      const from = first(one.x, this.view[0]), to = Math.max(first(one.x, this.view[1]) + 1, from + 1);
      for (const list of [one.y, one.low, one.high]) if (list) for (let k = from; k < to && k < list.length; k++) take(list[k]);
    }
    if (panel.zero) take(0);
    if (panel.noise) { take(1.5 * panel.noise); take(-1.5 * panel.noise); }
    if (low > high) return [0, 1];
    const margin = 0.06 * (high - low) || Math.abs(high) || 1;
    return [low - margin * (panel.zero && low === 0 ? 0 : 1), high + margin];
  }
  draw() {
    this.width = Math.max(this.figure.clientWidth, 280);
    const bodies = this.data.panels.map((panel) => panel.height * TALL);
    const height = bodies.reduce((sum, each) => sum + each + GAP + 14, 0) + FOOT - 8;
    this.svg.replaceChildren();
    this.svg.setAttribute("viewBox", `0 0 ${this.width} ${height}`);
    let top = 16;
    this.data.panels.forEach((panel, k) => { this.panel(panel, top, bodies[k]); top += bodies[k] + GAP + 14; });
    this.bottom = top - GAP - 14;
    const [list, step] = ticks(...this.view, (this.width - LEFT) / 80);
    for (const x of list) element(this.svg, "text", {x: this.toX(x), y: this.bottom + 15, "text-anchor": "middle"}, label(x, step));
    element(this.svg, "text", {x: (LEFT + this.width) / 2, y: this.bottom + 31, "text-anchor": "middle"}, this.data.label);
    this.cursor = element(this.svg, "line", {class: "cursor", y1: 16, y2: this.bottom, visibility: "hidden"});
    this.select = element(this.svg, "rect", {class: "select", y: 16, height: this.bottom - 16, width: 0});
  }
  panel(panel, top, height) {
    const [low, high] = this.range(panel), right = this.width - RIGHT, id = `clip${this.number}_${Math.round(top)}`;
    const toY = (y) => top + height - (y - low) / (high - low) * height;
    element(element(this.svg, "clipPath", {id}), "rect", {x: LEFT, y: top, width: right - LEFT, height});
    const inside = element(this.svg, "g", {"clip-path": `url(#${id})`});
    for (const [from, to, kind] of this.data.spans) {
      const [a, b] = [Math.max(this.toX(from), LEFT), Math.min(this.toX(to), right)];
      if (b > a) element(inside, "rect", {class: kind, x: a, y: top, width: b - a, height});
    }
    if (panel.noise) element(inside, "rect", {class: "noise", x: LEFT, y: toY(panel.noise), width: right - LEFT,
      height: Math.max(toY(-panel.noise) - toY(panel.noise), 1)});
    const [list, step] = ticks(low, high, height / 34);
    for (const y of list) {
      element(this.svg, "line", {class: "grid", x1: LEFT, x2: right, y1: toY(y), y2: toY(y)});
      element(this.svg, "text", {x: LEFT - 5, y: toY(y) + 4, "text-anchor": "end"}, label(y, step));
    }
    element(this.svg, "line", {class: "axis", x1: LEFT, x2: right, y1: top + height, y2: top + height});
    element(this.svg, "text", {x: LEFT, y: top - 5}, panel.label);
    for (const one of panel.series.filter((each) => each.shown)) {
      if (one.low) {
        const there = one.x.map((x, k) => `${this.toX(x)} ${toY(one.high[k])}`);
        const back = one.x.map((x, k) => `${this.toX(x)} ${toY(one.low[k])}`).reverse();
        element(inside, "path", {class: `band ${one.kind}`, d: `M${[...there, ...back].join("L")}Z`});
      }
      element(inside, "path", {class: `curve ${one.kind}`, d: path(one.x, one.y, this.view, (x) => this.toX(x), toY)});
    }
  }
  show(x) {
    this.cursor.setAttribute("visibility", "visible");
    for (const end of ["x1", "x2"]) this.cursor.setAttribute(end, this.toX(x));
    const digits = (v) => v === null ? "-" : Number(v.toPrecision(4)).toString(), parts = [];
    for (const panel of this.data.panels) for (const one of panel.series.filter((each) => each.shown)) {
      const k = Math.min(first(one.x, x), one.x.length - 1);
      parts.push(`${this.data.panels.length > 1 ? panel.label.replace(/ \[.*/, "") + ", " : ""}${one.name} ${digits(one.y[k])}`);
    }
    this.readout.textContent = `${this.data.label.replace(/ \[.*/, "")} ${digits(x)}: ${parts.join("; ")}`;
  }
  listen() {
    const at = (event) => {
      const box = this.svg.getBoundingClientRect(), pixel = (event.clientX - box.left) * this.width / box.width;
      return this.fromX(Math.min(Math.max(pixel, LEFT), this.width - RIGHT));
    };
    let begun = null;
    this.svg.onpointerdown = (event) => { begun = at(event); this.svg.setPointerCapture(event.pointerId); };
    this.svg.onpointermove = (event) => {
      const x = at(event);
      this.show(x);
      if (begun === null) return;
      const [a, b] = [this.toX(begun), this.toX(x)].sort((p, q) => p - q);
      this.select.setAttribute("x", a);
      this.select.setAttribute("width", b - a);
    };
    this.svg.onpointerup = (event) => {
      const ends = [begun, at(event)].sort((p, q) => p - q), wide = this.toX(ends[1]) - this.toX(ends[0]) > 6;
      begun = null;
      this.select.setAttribute("width", 0);
      if (wide) this.zoom(ends);
    };
    this.svg.onpointercancel = () => { begun = null; this.select.setAttribute("width", 0); };
    this.svg.ondblclick = () => this.zoom(this.whole);
    this.figure.onkeydown = (event) => {
      if (event.target !== this.figure) return;
      const [a, b] = this.view, w = b - a, moves = {ArrowLeft: [a - w / 5, b - w / 5], ArrowRight: [a + w / 5, b + w / 5],
        "+": [a + w / 4, b - w / 4], "-": [a - w / 2, b + w / 2], 0: this.whole, Escape: this.whole}[event.key];
      if (moves) { event.preventDefault(); this.zoom(moves); }
    };
  }
}
/* A plot is made when it comes near the screen; one that is folded away is not drawn at all. */
const make = (figure) => {
  if (figure.made) return;
  figure.made = true;
  plots.push(new Plot(figure, plots.length));
};
const near = new IntersectionObserver((entries) => {
  for (const entry of entries) if (entry.isIntersecting) { near.unobserve(entry.target); make(entry.target); }
}, {rootMargin: "3000px"});
const figures = [...document.querySelectorAll("figure.plot")];
for (const figure of figures) near.observe(figure);
let waiting = 0;
const again = () => { for (const plot of plots) if (plot.figure.clientWidth) plot.draw(); };
addEventListener("resize", () => { cancelAnimationFrame(waiting); waiting = requestAnimationFrame(again); });
let unfolded = [];
addEventListener("beforeprint", () => {
  unfolded = [...document.querySelectorAll("details:not([open])")];
  for (const folded of unfolded) folded.open = true;
  for (const figure of figures) if (figure.clientWidth) make(figure);
  again();
});
addEventListener("afterprint", () => { for (const folded of unfolded) folded.open = false; });
})();
