// The tabs beside the scene: switches, what the run says of itself, the text of the scene.

class Panel {
  constructor(onopen) {
    this.tabs = [...document.querySelectorAll("#tabs button")];
    for (const tab of this.tabs) tab.addEventListener("click", () => { this.open(tab.dataset.tab); onopen(); });
    this.switches = {};
    this.settings = [];
  }

  // Do what all switches say once more: what they switch was made anew.
  apply() { for (const set of this.settings) set(); }

  open(name) {
    for (const tab of this.tabs) {
      tab.setAttribute("aria-selected", String(tab.dataset.tab === name));
      element(`tab-${tab.dataset.tab}`).hidden = tab.dataset.tab !== name;
    }
  }

  heading(text) { element("tab-display").append(make("h2", text)); }

  // A named switch; `set(on)` is called now and when it changes.
  toggle(name, label, on, set, { key = "", color = "", into = element("tab-display") } = {}) {
    const input = make("input", "", { type: "checkbox" });
    input.checked = on;
    input.addEventListener("change", () => set(input.checked));
    const row = make("label", "", { class: "switch" }, input);
    if (color) row.append(make("i", "", { style: `background:${color}` }));
    row.append(make("span", label));
    if (key) row.append(make("kbd", key));
    into.append(row);
    this.settings.push(() => set(input.checked));
    set(on);
    if (name) this.switches[name] = { key, flip: () => input.click(), input };
  }

  slider(label, least, largest, value, set) {
    const input = make("input", "", { type: "range", min: least, max: largest, step: "any", value, "aria-label": label });
    input.addEventListener("input", () => set(Number(input.value)));
    this.settings.push(() => set(Number(input.value)));
    input.addEventListener("dblclick", () => { input.value = value; set(value); });
    element("tab-display").append(make("div", "", { class: "row" }, make("span", label), input));
  }

  select(label, options, set) {
    const select = make("select", "", { "aria-label": label }, ...options.map(([value, text]) => make("option", text, { value })));
    select.addEventListener("change", () => set(select.value));
    element("tab-display").append(make("div", "", { class: "row" }, make("span", label), select));
    return select;
  }
}

function tellRun(about) {
  const tab = element("tab-run");
  tab.replaceChildren();
  const section = (title, ...content) => tab.append(make("h2", title), ...content);
  const table = (rows) => make("table", "", {}, ...rows.map(([name, value]) => make("tr", "", {}, make("th", name), make("td", value, { class: "value" }))));
  const list = (items) => make("ul", "", { class: "notes" }, ...items.map((item) => make("li", item)));
  const written = (value) => (typeof value === "object" && value !== null ? JSON.stringify(value) : String(value));
  section("Ledger", ledger(about.ledger));
  if (about.view_notes.length) section("This page", list(about.view_notes));
  const { steps, rejected, rhs, wall_time_s: wall } = about.stats;
  section("Run", table([
    ["status", about.status], ["method", about.method], ["integrator", about.integrator],
    ["reported", `${about.instants} instants`], ["steps", `${steps}, ${rejected} rejected`],
    ["evaluations", rhs], ["duration", `${short(wall)} s`]]));
  if (about.events.length) section("Events", list(about.events.map((e) => e.text)));
  if (about.notes.length) section("Notes", list(about.notes));
  section("Settings", table(Object.entries(about.settings).map(([k, v]) => [k, written(v)])));
  section("Versions", table([...Object.entries(about.versions), ["three.js", `r${THREE.REVISION}`]]));
  element("scene-text").textContent = about.scene;
}

function ledger(entries) {
  const rows = Object.entries(entries).map(([name, entry]) => {
    const verdict = entry.ok === null ? ["", "no limit"] : entry.ok ? ["good", "ok"] : ["bad", "beyond"];
    const number = (v) => make("td", v === null ? "\u2013" : Number.isFinite(v) ? v.toExponential(1) : String(v), { class: "number" });
    return make("tr", "", { title: entry.text }, make("th", name.replaceAll("_", " ")), number(entry.value), number(entry.limit),
      make("td", verdict[1], { class: verdict[0] }));
  });
  const head = make("tr", "", {}, ...["", "value", "limit", ""].map((text) => make("td", text, { class: "number" })));
  return make("table", "", {}, head, ...rows);
}
