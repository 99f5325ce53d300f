// Paths of points: faint as a whole, strong up to the present.

const LONGEST_TRACE = 4000, SMOOTH_TRACE = 600;

class Traces {
  constructor(data, stage, motion) {
    this.stage = stage;
    this.motion = motion;
    this.shown = new Map();
    this.visible = true;
    // Instants of the drawn paths: of many frames some, of few frames some between them, too.
    const { frames } = motion, parts = frames < SMOOTH_TRACE ? Math.ceil(SMOOTH_TRACE / frames) : 1;
    const stride = Math.ceil(frames / LONGEST_TRACE);
    this.times = [];
    for (let f = 0; f < frames - 1; f += stride) {
      const step = motion.t[Math.min(f + stride, frames - 1)] - motion.t[f];
      for (let k = 0; k < parts; k++) this.times.push(motion.t[f] + (step * k) / parts);
    }
    this.times.push(motion.end);
    this.choices = data.bodies.map((b, k) => ({ name: b.name, body: k + 1, at: [0, 0, 0], color: b.color }));
    for (const point of data.points) {
      if (point.body > 0) this.choices.push({ ...point, color: data.bodies[point.body - 1].color });
    }
  }

  show(choice, visible) {
    if (!visible) {
      this.shown.get(choice)?.forEach((line) => { this.stage.scene.remove(line); line.geometry.dispose(); });
      this.shown.delete(choice);
    } else if (!this.shown.has(choice) && this.motion.frames > 1) {
      const path = this.motion.pathAt(this.times, choice.body, choice.at);
      this.shown.set(choice, [this.#line(path, choice.color, 1, 0.28), this.#line(path, choice.color, 2.2, 1)]);
    }
  }

  #line(path, color, linewidth, opacity) {
    const geometry = new THREE.LineGeometry();
    geometry.setPositions(path);
    const line = new THREE.Line2(geometry, new THREE.LineMaterial({ color, linewidth, opacity, transparent: true }));
    line.frustumCulled = false;
    line.visible = this.visible;
    this.stage.scene.add(line);
    return line;
  }

  setVisible(visible) {
    this.visible = visible;
    for (const lines of this.shown.values()) for (const line of lines) line.visible = visible;
  }

  update(t) {
    let done = 0;
    while (done + 1 < this.times.length && this.times[done + 1] <= t) done++;
    for (const [, past] of this.shown.values()) past.geometry.instanceCount = done;
  }
}
