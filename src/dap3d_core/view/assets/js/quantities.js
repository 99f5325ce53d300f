// What plots can draw: curves that Python stored, and those that follow from motion and arrows.

function catalogue(data, motion, arrows) {
  const found = new Map();
  const add = (one) => { if (!found.has(one.name)) found.set(one.name, one); };
  for (const s of data.series) {
    add({ name: s.name, unit: s.unit, label: s.label, group: data.asked.includes(s.name) ? "Asked for" : "Energy",
      names: s.columns, values: lazy(() => columns(float64(s.values), s.columns.length)),
      rates: s.rates && lazy(() => columns(float64(s.rates), s.columns.length)) });
  }
  data.bodies.forEach((body, k) => add({ name: `${body.name}.r`, unit: "m", label: `position of ${body.name}`, group: "Position of a body",
    names: axes(body.name), ...course(motion, k + 1, [0, 0, 0]) }));
  data.points.filter((p) => p.body > 0).forEach((p) => add({ name: `${p.name}.r`, unit: "m", label: `position of ${p.name}`, group: "Position of a point",
    names: axes(p.name), ...course(motion, p.body, p.at) }));
  for (const group of Object.values(arrows.groups)) {
    for (const item of group.items) {
      const name = `${item.name}.${item.what}.norm`;
      add({ name, unit: group.unit, label: `${group.label.toLowerCase()} of ${item.name}`, group: group.label,
        names: [name], values: lazy(() => [norms(item.values)]) });
    }
  }
  return found;
}

// Where a point is at the instants, and its velocity by the slopes between which the scene moves.
function course(motion, body, at) {
  const values = lazy(() => columns(Float64Array.from(motion.path(body, at)), 3));
  return { values, rates: lazy(() => values().map((one) => one.map((_, n) => motion.slope(n).reduce((sum, [f, w]) => sum + w * one[f], 0)))) };
}

const axes = (owner) => ["x", "y", "z"].map((axis) => `${owner}.r.${axis}`);

function lazy(compute) {
  let value;
  return () => (value ??= compute());
}

function columns(flat, width) {
  const count = flat.length / width;
  return Array.from({ length: width }, (_, k) => Float64Array.from({ length: count }, (_, n) => flat[n * width + k]));
}

const norms = (v) => Float64Array.from({ length: v.length / 3 }, (_, n) => Math.hypot(v[3 * n], v[3 * n + 1], v[3 * n + 2]));
