// The points of a sweep: a slider for each number of a grid or one over samples, and what each gave.

// A point holds what differs from the data of the page; `null` where it has no motion.
const dataOf = (data, point) => (point.data === null ? null : { ...data, ...point.data });

// Kinds of arrows that any point has.
function kindsOfArrows(data) {
  const every = [data, ...(data.sweep?.points ?? []).map((point) => point.data ?? {})];
  return new Set(every.flatMap((one) => one.arrows ?? []).map((a) => `${a.layer} ${a.what}`));
}

// Whether a key is for a slider of points, which has the arrow keys itself.
function isPointSlider(target, key) {
  return target.dataset?.axis !== undefined && (key.startsWith("Arrow") || key === "Home" || key === "End");
}

class Sweep {
  constructor(app, about) {
    Object.assign(this, { app, about, base: app.data, shown: app.data });
    const first = about.points.findIndex((point) => point.data !== null);
    this.strides = about.sliders.map((_, k) => about.sliders.slice(k + 1).reduce((n, s) => n * s.values.length, 1));
    this.places = about.sliders.map((s, k) => Math.floor(first / this.strides[k]) % s.values.length);
    const box = element("sweep");
    box.hidden = false;
    this.sliders = about.sliders.map((slider, k) => this.#slider(box, slider, k));
    this.table = make("table");
    this.note = make("p", "", { role: "status" });
    box.append(this.note, this.table, ...about.notes.map((words) => make("p", words)));
    this.#tell();
  }

  #slider(box, slider, k) {
    const input = make("input", "", { type: "range", min: 0, max: slider.values.length - 1, step: 1, "aria-label": slider.name, "data-axis": k });
    const value = make("output");
    input.addEventListener("input", () => this.choose(this.places.map((p, n) => (n === k ? Number(input.value) : p))));
    input.disabled = slider.values.length < 2;
    box.append(make("label", "", { class: "axis" }, make("span", slider.name), value, input));
    return { input, value };
  }

  get point() { return this.about.points[this.places.reduce((sum, p, k) => sum + p * this.strides[k], 0)]; }

  choose(places) {
    this.places = places;
    this.#tell();
    if (this.waiting) return; // sliding gives more points than can be drawn
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      const data = dataOf(this.base, this.point);
      element("nothing").textContent = data === null ? `This point has no motion. ${this.point.note}` : "";
      this.app.exchange(data);
    });
  }

  #tell() {
    const { about, point, places } = this;
    this.sliders.forEach(({ input, value }, k) => {
      input.value = places[k];
      const { values, unit, of } = about.sliders[k];
      value.textContent = of === undefined ? withUnit(values[places[k]], unit) : `${values[places[k]] + 1} of ${of}`;
      input.setAttribute("aria-valuetext", value.textContent);
    });
    const axes = new Set(about.sliders.map((s) => s.name));
    const row = (one, value) => make("tr", "", { title: one.label }, make("th", one.name), make("td", value === null ? "\u2013" : withUnit(value, one.unit), { class: "number" }));
    this.table.replaceChildren(
      ...about.numbers.flatMap((one, k) => (axes.has(one.name) ? [] : [row(one, point.values[k])])),
      ...about.outputs.map((one, k) => row(one, point.outputs[k])));
    const words = [point.status === "done" ? "" : point.status, point.note].filter((word) => word).join(": ");
    this.note.textContent = words;
    this.note.className = point.status === "failed" || point.status === "stopped" ? "bad" : "";
  }
}

const withUnit = (value, unit) => `${short(value)} ${unitText(unit)}`.trim();
