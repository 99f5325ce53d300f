// Puts the parts together. `window.dap3d` is what scripts and tests steer the page with.

const FEW = 12; // so many bodies or joints can all be labelled and have arrows at once

class App {
  constructor(data) {
    this.data = data;
    this.motion = new Motion(data);
    this.follow = 0;
    this.theme = window.matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
    this.title();
    tellRun(data.about);
    this.stage = this.makeStage();
    this.transport = new Transport(this.motion, () => this.request());
    if (this.stage) {
      this.furnish();
      this.listenToCanvas();
    }
    this.arrows ??= { groups: {} };
    this.plots = new Plots(element("plots"), element("plot-add"), catalogue(data, this.motion, this.arrows), this.motion, (t) => this.transport.seek(t));
    this.panel = new Panel(() => this.plots.drawAll());
    if (this.stage) this.furnishPanel();
    this.firstPlots();
    this.applyTheme();
    this.sweep = data.sweep ? new Sweep(this, data.sweep) : null;
    listen(this);
    element("theme").addEventListener("click", () => this.flipTheme());
    element("fit").addEventListener("click", () => this.fit());
    element("help-open").addEventListener("click", () => element("help").showModal());
    new ResizeObserver(() => { this.stage?.resize(); this.plots.drawAll(); this.request(); }).observe(element("scene"));
    this.request();
    if (data.play && !window.matchMedia("(prefers-reduced-motion: reduce)").matches) this.transport.play();
  }

  title() {
    const { about } = this.data;
    element("title").textContent = about.status === "done" ? about.title : `${about.title} (${about.status})`;
    element("subtitle").textContent = about.description;
  }

  makeStage() {
    try {
      return new Stage(this.data, element("canvas"));
    } catch (error) {
      element("fault").hidden = false;
      element("fault").textContent = `The scene cannot be drawn: this browser gives no WebGL (${error.message}). Plots and tables work.`;
      return null;
    }
  }

  furnish() {
    const { data, stage, motion } = this;
    this.marks = new Marks(data, stage);
    this.arrows = new Arrows(data, stage, motion);
    this.traces = new Traces(data, stage, motion);
    motion.place(motion.start);
    stage.place(motion);
    this.labels = new Labels(data, stage, element("labels"));
  }

  listenToCanvas() {
    this.stage.onchange = () => this.request();
    const canvas = element("canvas");
    let down = null;
    canvas.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointerup", (event) => {
      if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 4) this.tell(this.pick(event));
    });
    canvas.addEventListener("dblclick", (event) => {
      const found = this.pick(event);
      const body = found && this.bodyOf(found);
      if (body) this.setFollow(body);
    });
  }

  // Another motion of the same mechanism: data of another point of a sweep, or null for none.
  exchange(data) {
    document.body.classList.toggle("nothing", data === null);
    if (data === null) { this.request(); return; }
    const { stage } = this;
    this.data = data;
    this.motion = new Motion(data);
    this.title();
    tellRun(data.about);
    if (stage) {
      stage.clear();
      if (stage.gravityTip) stage.setGravity(data.stage.gravity);
      element("labels").replaceChildren();
      this.furnish();
      this.panel.apply();
    }
    this.plots.exchange(catalogue(data, this.motion, this.arrows), this.motion);
    this.transport.exchange(this.motion);
  }

  furnishPanel() {
    const { data, panel, stage } = this;
    const redraw = (set) => (on) => { set(on); this.request(); };
    panel.heading("Show");
    const names = { bodies: "Bodies", shapes: "Shapes", joints: "Joints", forces: "Springs and forces", inertia: "Inertia ellipsoids" };
    Object.entries(names).forEach(([layer, label], k) => {
      if (this.marks.layers[layer]) panel.toggle(label, label, true, redraw((on) => this.marks.show(layer, on)), { key: String(k + 1) });
    });
    panel.toggle("Labels", "Labels", data.bodies.length <= FEW && stage.width > 480, redraw((on) => { this.labels.visible = on; }), { key: "N" });
    panel.toggle("Traces", "Traces", true, redraw((on) => this.traces.setVisible(on)), { key: "T" });
    panel.toggle("Ground", "Ground", true, redraw((on) => { stage.grid.visible = on; }), { key: "G" });
    if (stage.gravityText) {
      panel.toggle("Gravity", "Gravity", true, redraw((on) => {
        stage.gravity.visible = on;
        this.labels.hidden[on ? "delete" : "add"]("ground");
      }), { key: "W" });
    }
    const kinds = kindsOfArrows(data);
    if (kinds.size) {
      panel.heading("Arrows");
      for (const [key, group] of Object.entries(ARROWS)) {
        if (!kinds.has(key)) continue;
        const on = key.endsWith("force") && (this.arrows.groups[key]?.items.length ?? 0) <= 2 * FEW;
        panel.toggle(group.label, group.label, on, redraw((v) => this.arrows.show(key, v)), { key: group.key, color: group.color });
      }
      panel.slider("Length", -2, 2, 0, (x) => { this.arrows.factor = 10 ** x; this.request(); });
    }
    panel.heading("Camera");
    const options = [[0, "nothing"], ...data.bodies.map((b, k) => [k + 1, b.name])];
    this.followSelect = panel.select("Follow", options, (value) => this.setFollow(Number(value)));
    panel.heading("Traces of");
    const list = make("div", "", { class: "list" });
    element("tab-display").append(list);
    const first = this.firstTraces();
    this.traces.choices.forEach((choice, k) => {
      panel.toggle("", choice.name, first.includes(choice), redraw((on) => this.traces.show(this.traces.choices[k], on)), { color: choice.color, into: list });
    });
  }

  // Mass centres that move, of few bodies all, of many the last.
  firstTraces() {
    const bodies = this.traces.choices.slice(0, this.data.bodies.length);
    return bodies.length <= FEW ? bodies : bodies.slice(-1);
  }

  // What was asked for; else energies where there are any, the last body, the joints' reactions.
  firstPlots() {
    const { asked, bodies, joints } = this.data, { catalogue: all } = this.plots;
    const energies = ["energy.kinetic", "energy.potential", "energy.total"];
    const reactions = joints.map((j) => `${j.name}.force.norm`).filter((name) => all.has(name));
    const usual = [...energies, `${bodies.at(-1).name}.r`, ...(reactions.length <= 6 ? reactions : reactions.slice(0, 1))];
    for (const name of asked.length ? asked : usual) this.plots.add(name);
  }

  pick(event) {
    const box = element("canvas").getBoundingClientRect();
    const at = new THREE.Vector2(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
    const ray = new THREE.Raycaster();
    ray.setFromCamera(at, this.stage.camera);
    return this.marks.pick(ray);
  }

  tell(found) {
    const about = found && [...this.data.joints, ...this.data.forces].find((one) => one.name === found.name && found.layer in { joints: 1, forces: 1 });
    element("picked").textContent = !found ? "" : about ? `${about.name}: ${about.type}, ${about.bodies.join(" \u2013 ")}` : found.name;
  }

  bodyOf({ layer, name }) {
    if (layer === "bodies") return this.data.bodies.findIndex((b) => b.name === name) + 1;
    const one = [...this.data.joints, ...this.data.forces].find((o) => o.name === name);
    return one ? this.data.bodies.findIndex((b) => b.name === one.bodies[0]) + 1 : 0;
  }

  setFollow(body) {
    this.follow = body;
    this.followSelect.value = String(body);
    this.followed = null;
    this.request();
  }

  followNext() { this.setFollow((this.follow + 1) % (this.data.bodies.length + 1)); }

  fit() {
    this.stage?.fit();
    this.followed = null;
    this.request();
  }

  flipTheme() {
    this.theme = this.theme === "dark" ? "light" : "dark";
    this.applyTheme();
  }

  applyTheme() {
    document.documentElement.dataset.theme = this.theme;
    element("theme").textContent = this.theme === "dark" ? "Light" : "Dark";
    this.stage?.setTheme(this.theme);
    this.plots.drawAll();
    this.request();
  }

  // One picture as soon as the browser wants one; while playing one after the other.
  request() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame((now) => {
      this.asked = false;
      this.transport.tick(now);
      this.draw();
      if (this.transport.playing) this.request();
    });
  }

  draw() {
    const { t } = this.transport;
    this.motion.place(t);
    this.pictures = (this.pictures ?? 0) + 1;
    if (this.stage) {
      this.stage.place(this.motion);
      this.keepUp();
      this.marks.update();
      this.arrows.update(t);
      this.traces.update(t);
      this.stage.camera.updateMatrixWorld();
      this.labels.update();
      this.arrows.legend(element("legend"));
      this.stage.render();
    }
    this.plots.update(t);
  }

  // The camera moves along with the body that it follows.
  keepUp() {
    if (!this.follow) return;
    const now = new THREE.Vector3().setFromMatrixPosition(this.stage.matrices[this.follow]);
    this.stage.shift(now.clone().sub(this.followed ?? this.stage.controls.target));
    this.followed = now;
    this.stage.camera.lookAt(this.stage.controls.target);
  }

  // Where a point of a body is drawn, global axes.
  drawnAt(name, at = [0, 0, 0]) {
    const body = this.data.bodies.findIndex((b) => b.name === name) + 1;
    return new THREE.Vector3().fromArray(at).applyMatrix4(this.stage.matrices[body]).toArray();
  }
}

const app = new App(DATA);
window.dap3d = {
  app,
  play: () => app.transport.play(),
  pause: () => app.transport.pause(),
  seek: (t) => { app.transport.seek(t); app.draw(); },
  get time() { return app.transport.t; },
  get playing() { return app.transport.playing; },
  get pictures() { return app.pictures; },
  drawnAt: (name, at) => app.drawnAt(name, at),
  choose: (...places) => app.sweep.choose(places),
  onScreen: (name, at) => app.stage.project(new THREE.Vector3().fromArray(app.drawnAt(name, at))),
};
document.documentElement.dataset.ready = "yes";
