// Curves over time beside the scene, one panel a unit, with a cursor at the present instant.

const LEFT = 46, RIGHT = 6, TOP = 6, BOTTOM = 32;

class Plots {
  constructor(box, choice, catalogue, motion, seek) {
    Object.assign(this, { box, choice, catalogue, motion, seek, panels: [] });
    const groups = new Map();
    for (const one of catalogue.values()) {
      if (!groups.has(one.group)) groups.set(one.group, make("optgroup", "", { label: one.group }));
      groups.get(one.group).append(make("option", one.name, { value: one.name }));
    }
    choice.append(make("option", "Add a curve \u2026", { value: "" }), ...groups.values());
    choice.addEventListener("change", () => { this.add(choice.value); choice.value = ""; });
  }

  // The same curves of another motion.
  exchange(catalogue, motion) {
    Object.assign(this, { catalogue, motion });
    for (const panel of this.panels) {
      panel.quantities = panel.quantities.map((q) => catalogue.get(q.name) ?? { ...q, values: () => [] });
      this.#keys(panel);
    }
    this.t = Math.min(Math.max(this.t ?? motion.start, motion.start), motion.end);
    this.drawAll();
  }

  add(name) {
    const quantity = this.catalogue.get(name);
    if (!quantity) return;
    let panel = this.panels.find((p) => p.unit === quantity.unit);
    if (!panel) this.panels.push((panel = this.#panel(quantity.unit)));
    if (panel.quantities.includes(quantity)) return;
    panel.quantities.push(quantity);
    this.#keys(panel);
    this.draw(panel);
  }

  remove(panel, quantity) {
    panel.quantities = panel.quantities.filter((q) => q !== quantity);
    if (!panel.quantities.length) {
      panel.element.remove();
      this.panels = this.panels.filter((p) => p !== panel);
    } else {
      this.#keys(panel);
      this.draw(panel);
    }
  }

  #panel(unit) {
    const canvas = make("canvas"), cursor = make("div", "", { class: "cursor" });
    const frame = make("div", "", { class: "frame" }, canvas, cursor);
    const keys = make("div", "", { class: "keys" }), top = make("div", "", { class: "top" });
    const panel = { unit, canvas, cursor, frame, keys, top, quantities: [], curves: [], element: make("div", "", { class: "plot" }, top, frame, keys) };
    const scrub = (event) => {
      const share = (event.offsetX - LEFT) / (frame.clientWidth - LEFT - RIGHT);
      this.seek(this.motion.start + Math.min(Math.max(share, 0), 1) * (this.motion.end - this.motion.start));
    };
    frame.addEventListener("pointerdown", (event) => { frame.setPointerCapture(event.pointerId); scrub(event); });
    frame.addEventListener("pointermove", (event) => { if (event.buttons) scrub(event); });
    this.box.append(panel.element);
    return panel;
  }

  #keys(panel) {
    panel.curves = panel.quantities.flatMap((q) => q.values().map((values, k) => ({ q, values, ...this.slopes(q, k, values), name: q.names[k] })));
    panel.keys.replaceChildren(...panel.curves.map((curve, k) => {
      curve.color = PALETTE[k % PALETTE.length];
      curve.dash = [[], [6, 3], [2, 2]][Math.floor(k / PALETTE.length) % 3];
      curve.now = make("b");
      return make("div", "", { title: curve.q.label }, make("i", "", { style: `background:${curve.color}` }), make("em", curve.name), curve.now);
    }));
    const drop = make("button", "\u00d7", { title: "Remove the last curve", "aria-label": "Remove the last curve" });
    drop.addEventListener("click", () => this.remove(panel, panel.quantities.at(-1)));
    panel.top.replaceChildren(make("span", ["", "1"].includes(panel.unit) ? "" : `[${unitText(panel.unit)}]`), drop);
  }

  // Slopes at the begin of the intervals from each instant on, and at the end of those before it.
  slopes(quantity, k, values) {
    const rates = quantity.rates?.()[k];
    return rates ? { after: rates, before: rates } : shaped(this.motion.t, values, this.motion.cuts);
  }

  draw(panel) {
    const { canvas, frame, curves } = panel, ratio = window.devicePixelRatio || 1;
    const width = frame.clientWidth, height = frame.clientHeight;
    if (!width) return; // its tab is closed
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const g = canvas.getContext("2d"), style = getComputedStyle(document.documentElement);
    g.scale(ratio, ratio);
    g.font = "11px system-ui, sans-serif";
    const [low, high] = limits(curves);
    panel.smallest = 1e-9 * Math.max(Math.abs(low), Math.abs(high)); // less is the rounding of zero
    const { start, end } = this.motion, span = end - start || 1;
    const x = (t) => LEFT + ((t - start) / span) * (width - LEFT - RIGHT);
    const y = (v) => TOP + ((high - v) / (high - low)) * (height - TOP - BOTTOM);
    g.strokeStyle = style.getPropertyValue("--line");
    g.fillStyle = style.getPropertyValue("--soft");
    g.lineWidth = 1;
    g.textAlign = "right";
    g.textBaseline = "middle";
    for (const v of ticks(low, high, 5)) { rule(g, LEFT, y(v), width - RIGHT, y(v)); g.fillText(short(v), LEFT - 5, y(v)); }
    g.textBaseline = "alphabetic";
    g.textAlign = "center";
    for (const t of ticks(start, end, 5)) { rule(g, x(t), TOP, x(t), height - BOTTOM); g.fillText(short(t), Math.min(x(t), width - 12), height - 18); }
    g.fillText("time [s]", (LEFT + width - RIGHT) / 2, height - 4);
    g.lineWidth = 1.4;
    g.lineJoin = "round";
    g.save();
    g.beginPath();
    g.rect(LEFT, TOP - 2, width - LEFT - RIGHT, height - TOP - BOTTOM + 4);
    g.clip();
    for (const curve of curves) stroke(g, curve, this.motion.t, x, y, width);
    g.restore();
    panel.drawn = width;
    this.update(this.t ?? start);
  }

  drawAll() {
    for (const panel of this.panels) this.draw(panel);
  }

  update(t) {
    this.t = t;
    const { start, end } = this.motion, { frame, part } = this.motion.locate(t);
    const share = (t - start) / (end - start || 1);
    for (const panel of this.panels) {
      if (!panel.drawn) continue;
      panel.cursor.style.left = `${LEFT + share * (panel.drawn - LEFT - RIGHT)}px`;
      for (const curve of panel.curves) {
        const value = valueAt(curve, this.motion.t, frame, part);
        curve.now.textContent = short(Math.abs(value) < panel.smallest ? 0 : value);
      }
    }
  }
}

function limits(curves) {
  let low = Infinity, high = -Infinity;
  for (const { values } of curves) {
    for (const v of values) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
  }
  if (!(high >= low)) return [0, 1];
  const size = Math.max(Math.abs(low), Math.abs(high));
  const room = Math.max(0.06 * (high - low), 1e-6 * size) || 1; // rounding alone is no curve
  return [low - room, high + room];
}

function ticks(low, high, most) {
  if (!(high > low)) return [low];
  const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= raw * (1 - 1e-9));
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(Number((k * step).toPrecision(12)));
  return found;
}

function rule(g, x0, y0, x1, y1) {
  g.beginPath();
  g.moveTo(Math.round(x0) + 0.5, Math.round(y0) + 0.5);
  g.lineTo(Math.round(x1) + 0.5, Math.round(y1) + 0.5);
  g.stroke();
}

// The value of a curve a part of the way from one instant to the next, by a cubic.
function valueAt({ values, after, before }, t, n, part) {
  if (!(part > 0)) return values[n];
  const straight = values[n] * (1 - part) + values[n + 1] * part;
  const h = t[n + 1] - t[n], rise = values[n + 1] - values[n];
  return straight + part * (1 - part) * ((1 - part) * (h * after[n] - rise) - part * (h * before[n + 1] - rise));
}

// Slopes that keep the shape of a curve between its instants, as the figures of dap3d have them (Fritsch
// and Carlson 1980). Straight where an interval has a cut, at which the curve may jump, or has no length.
function shaped(t, values, cuts) {
  const count = values.length, after = new Float64Array(count), before = new Float64Array(count);
  const h = (k) => t[k + 1] - t[k], chord = (k) => (h(k) > 0 ? (values[k + 1] - values[k]) / h(k) : 0);
  let cut = 0;
  const broken = Array.from({ length: Math.max(count - 1, 0) }, (_, k) => {
    while (cut < cuts.length && cuts[cut] <= t[k]) cut++;
    return cuts[cut] <= t[k + 1] || !(h(k) > 0) || !Number.isFinite(chord(k));
  });
  const joins = (k) => k >= 0 && k < count - 1 && !broken[k];
  const end = (k, next) => { // of a part, by three points
    if (!joins(next)) return chord(k);
    const slope = ((2 * h(k) + h(next)) * chord(k) - h(k) * chord(next)) / (h(k) + h(next));
    if (slope * chord(k) <= 0) return 0;
    return chord(k) * chord(next) < 0 && Math.abs(slope) > 3 * Math.abs(chord(k)) ? 3 * chord(k) : slope;
  };
  for (let k = 0; k < count; k++) {
    const left = joins(k - 1), right = joins(k);
    if (left && right) {
      const a = chord(k - 1), b = chord(k), u = 2 * h(k) + h(k - 1), v = h(k) + 2 * h(k - 1);
      after[k] = before[k] = a * b > 0 ? (u + v) / (u / a + v / b) : 0;
    } else {
      if (right) after[k] = end(k, k + 1); else if (k < count - 1) after[k] = chord(k);
      if (left) before[k] = end(k - 1, k - 2); else if (k > 0) before[k] = chord(k - 1);
    }
  }
  return { after, before };
}

// Of many instants in one column of pixels the first and the last, the least and the largest value say
// all that is seen, in the order in which they come: other instants are left out.
function seen(values, column) {
  const kept = [];
  let first = 0;
  for (let n = 1; n <= values.length; n++) {
    if (n < values.length && column(n) === column(first)) continue;
    let low = first, high = first;
    for (let k = first; k < n; k++) {
      if (values[k] < values[low]) low = k;
      if (values[k] > values[high]) high = k;
    }
    kept.push(...[...new Set([first, low, high, n - 1])].sort((a, b) => a - b));
    first = n;
  }
  return kept;
}

function stroke(g, { values, after, before: arriving, color, dash }, t, x, y, width) {
  g.strokeStyle = color;
  g.setLineDash(dash);
  g.beginPath();
  const dense = values.length > 3 * width;
  const places = dense ? seen(values, (n) => (Number.isFinite(values[n]) ? Math.floor(x(t[n])) : NaN)) : values.keys();
  let before = -1;
  for (const n of places) {
    if (!Number.isFinite(values[n])) { before = -1; continue; }
    const px = x(t[n]), py = y(values[n]);
    if (before < 0) g.moveTo(px, py);
    else if (!dense) {
      const third = (t[n] - t[before]) / 3; // the cubic through both ends with their slopes
      g.bezierCurveTo(x(t[before] + third), y(values[before] + third * after[before]), x(t[n] - third), y(values[n] - third * arriving[n]), px, py);
    } else g.lineTo(px, py);
    before = n;
  }
  g.stroke();
  if (values.length === 1) { g.fillStyle = color; g.fillRect(x(t[0]) - 2, y(values[0]) - 2, 4, 4); }
  g.setLineDash([]);
}
