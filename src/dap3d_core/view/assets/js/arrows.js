// Arrows of forces and moments, to scale, and the legend that says which scale.

const ARROWS = {
  "reactions force": { label: "Reaction forces", color: "#AA3377", unit: "N", heads: 1, key: "5" },
  "reactions moment": { label: "Reaction moments", color: "#C9789F", unit: "N m", heads: 2, key: "6" },
  "forces force": { label: "Applied forces", color: "#CC3311", unit: "N", heads: 1, key: "7" },
  "contacts force": { label: "Contact forces", color: "#228833", unit: "N", heads: 1, key: "9" },
  "forces moment": { label: "Applied moments", color: "#DD8452", unit: "N m", heads: 2, key: "8" },
};

class Arrows {
  constructor(data, stage, motion) {
    this.stage = stage;
    this.motion = motion;
    this.scales = data.scales;
    this.factor = 1;
    this.unit = data.stage.unit;
    this.groups = {};
    for (const [key, look] of Object.entries(ARROWS)) {
      const items = data.arrows.filter((a) => `${a.layer} ${a.what}` === key)
        .map((a) => ({ ...a, values: float32(a.values), places: a.places && float32(a.places) }));
      if (!items.length) continue;
      const shafts = instances(SOLIDS.cylinder(items.length < MANY), items.length);
      const tips = instances(SOLIDS.cone(items.length < MANY), look.heads * items.length);
      for (const mesh of [shafts, tips]) { mesh.material.color.set(look.color); stage.scene.add(mesh); }
      this.groups[key] = { ...look, what: items[0].what, items, shafts, tips };
    }
  }

  update(t) {
    const { frame, part } = this.motion.locate(t);
    for (const group of Object.values(this.groups)) if (group.shafts.visible) this.#draw(group, frame, part);
  }

  #draw({ items, shafts, tips, heads, what }, frame, part) {
    const scale = this.scales[what] * this.factor, matrix = new THREE.Matrix4();
    const nothing = new THREE.Matrix4().makeScale(0, 0, 0);
    items.forEach((item, k) => {
      const v = new THREE.Vector3();
      for (const [f, w] of [[frame, 1 - part], [frame + 1, part]]) {
        if (w > 0) v.addScaledVector(new THREE.Vector3().fromArray(item.values, 3 * f), w);
      }
      const length = v.length() * scale;
      const drawn = length > 0.5 * this.unit;
      const direction = drawn ? v.normalize() : v;
      // a contact moves over its bodies: it is drawn where it was last
      const from = item.places ? new THREE.Vector3().fromArray(item.places, 3 * frame)
        : new THREE.Vector3().fromArray(item.at).applyMatrix4(this.stage.matrices[item.body]);
      const radius = Math.min(0.5 * this.unit, 0.1 * length), head = Math.min(5 * this.unit, 0.45 * length);
      const neck = from.clone().addScaledVector(direction, length - head);
      (drawn ? between(from, neck, radius, matrix) : nothing).toArray(shafts.instanceMatrix.array, 16 * k);
      const q = new THREE.Quaternion().setFromUnitVectors(Z, drawn ? direction : Z);
      for (let n = 0; n < heads; n++) {
        const foot = neck.clone().addScaledVector(direction, -0.7 * n * head);
        const size = new THREE.Vector3(3.2 * radius, 3.2 * radius, head);
        (drawn ? matrix.compose(foot, q, size) : nothing).toArray(tips.instanceMatrix.array, 16 * (heads * k + n));
      }
    });
    shafts.instanceMatrix.needsUpdate = tips.instanceMatrix.needsUpdate = true;
  }

  show(key, visible) {
    const group = this.groups[key];
    if (group) group.shafts.visible = group.tips.visible = visible;
  }

  // A bar for each kind of arrow that is on: a round value, as long as its arrow is where one looks.
  legend(box) {
    const pixels = this.stage.pixelsPerMetre;
    const rows = [];
    for (const what of ["force", "moment"]) {
      const shown = Object.values(this.groups).filter((g) => g.what === what && g.shafts.visible);
      if (!shown.length) continue;
      const value = niceBelow(90 / (this.scales[what] * this.factor * pixels));
      const width = value * this.scales[what] * this.factor * pixels;
      rows.push({ text: `${short(value)} ${shown[0].unit}`, width, color: shown[0].color });
    }
    const text = JSON.stringify(rows);
    if (text === this.legendText) return;
    this.legendText = text;
    box.replaceChildren(...rows.map((row) => make("div", "", {}, make("span", row.text),
      make("i", "", { style: `width:${row.width.toFixed(1)}px;background:${row.color};border-color:${row.color}` }))));
  }
}
