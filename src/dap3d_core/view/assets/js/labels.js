// Names beside bodies, joints and forces; one that would cover another is left out.

const MOST_LABELS = 120;

class Labels {
  constructor(data, stage, box) {
    this.stage = stage;
    this.visible = true;
    this.items = [];
    const add = (text, kind, body, at) => this.items.push({ kind, body, at: new THREE.Vector3().fromArray(at), span: make("span", text, { class: kind }) });
    if (stage.gravityText) add(stage.gravityText, "ground", 0, stage.gravityTip.toArray());
    data.bodies.forEach((b, k) => add(b.name, "body", k + 1, [0, 0, 0]));
    data.joints.forEach((j) => add(j.name, "joint", j.body, j.at));
    data.forces.forEach((f) => add(f.name, "force", f.body, f.at));
    this.items = this.items.slice(0, MOST_LABELS);
    box.append(...this.items.map((item) => item.span));
    this.hidden = new Set();
  }

  update() {
    const taken = [], place = new THREE.Vector3();
    for (const item of this.items) {
      const off = (!this.visible && item.kind !== "ground") || this.hidden.has(item.kind);
      const at = off ? null : this.stage.project(place.copy(item.at).applyMatrix4(this.stage.matrices[item.body]));
      item.width ??= item.span.offsetWidth;
      const box = at && { x: at.x + 8, y: at.y - 20, w: item.width + 3, h: 17 };
      const seen = box && at.z < 1 && box.x > 0 && box.y > 44 && box.x + box.w < this.stage.width && box.y + box.h < this.stage.height &&
        !taken.some((o) => box.x < o.x + o.w && o.x < box.x + box.w && box.y < o.y + o.h && o.y < box.y + box.h);
      item.span.style.visibility = seen ? "visible" : "hidden";
      if (seen) {
        taken.push(box);
        item.span.style.transform = `translate(${box.x.toFixed(1)}px, ${box.y.toFixed(1)}px)`;
      }
    }
  }
}
