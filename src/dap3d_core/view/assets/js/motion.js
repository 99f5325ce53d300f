// Where the bodies are at any time. At a reported instant exactly as the result has it; between two
// by cubic curves through them, so that coarse results move smoothly.

class Motion {
  constructor(data) {
    this.t = float64(data.t);
    this.cuts = data.cuts; // instants at which other quantities may jump
    this.poses = float32(data.poses);
    this.count = data.bodies.length;
    this.frames = this.t.length;
    this.start = this.t[0];
    this.end = this.t[this.frames - 1];
    this.r = new Float64Array(3 * (this.count + 1));
    this.q = new Float64Array(4 * (this.count + 1)); // e0, e1, e2, e3; ground first
    this.q[0] = 1;
    this.#makeContinuous();
  }

  // p and -p are one pose: neighbours get the same sign, so that curves between them are short.
  #makeContinuous() {
    const { poses, count, frames } = this;
    for (let f = 1; f < frames; f++) {
      for (let b = 0; b < count; b++) {
        const now = 7 * (f * count + b) + 3, before = now - 7 * count;
        let dot = 0;
        for (let k = 0; k < 4; k++) dot += poses[now + k] * poses[before + k];
        if (dot < 0) for (let k = 0; k < 4; k++) poses[now + k] = -poses[now + k];
      }
    }
  }

  // The last frame that is not after t, and how far t is on the way to the next (0 to 1).
  locate(t) {
    let low = 0, high = this.frames - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.t[middle] <= t) low = middle; else high = middle - 1;
    }
    if (low === this.frames - 1) return { frame: low, part: 0 };
    const step = this.t[low + 1] - this.t[low];
    return { frame: low, part: step > 0 ? Math.min(Math.max((t - this.t[low]) / step, 0), 1) : 0 };
  }

  // Put the poses of time t into r and q.
  place(t) {
    const { frame, part } = this.locate(t);
    const { count, r, q } = this, weights = this.#weights(frame, part), pose = new Float64Array(7);
    for (let b = 0; b < count; b++) {
      this.#pose(weights, b, pose);
      const length = part > 0 ? Math.hypot(pose[3], pose[4], pose[5], pose[6]) : 1;
      for (let k = 0; k < 3; k++) r[3 * (b + 1) + k] = pose[k];
      for (let k = 0; k < 4; k++) q[4 * (b + 1) + k] = pose[3 + k] / length;
    }
  }

  // Weights of frames in the cubic Hermite curve whose slopes are central differences.
  #weights(f, s) {
    if (s === 0) return [[f, 1]];
    const { t } = this;
    const step = t[f + 1] - t[f];
    const found = new Map();
    const add = (frame, weight) => found.set(frame, (found.get(frame) ?? 0) + weight);
    add(f, 1 + s * s * (2 * s - 3));
    add(f + 1, s * s * (3 - 2 * s));
    for (const [frame, weight] of this.slope(f)) add(frame, s * (1 - s) * (1 - s) * step * weight);
    for (const [frame, weight] of this.slope(f + 1)) add(frame, s * s * (s - 1) * step * weight);
    return [...found];
  }

  // Weights of frames in the slope at one of them: the central difference.
  slope(k) {
    const { t, frames } = this;
    let a = Math.max(k - 1, 0), b = Math.min(k + 1, frames - 1);
    if (!(t[b] > t[k])) b = k; // an event reports an instant twice: the slope is one-sided there
    if (!(t[k] > t[a])) a = k;
    const span = t[b] - t[a];
    return span > 0 ? [[b, 1 / span], [a, -1 / span]] : [];
  }

  // The path (3 numbers a frame) of a point of a body at the reported instants.
  path(body, at) {
    const out = new Float32Array(3 * this.frames), v = new THREE.Vector3(), q = new THREE.Quaternion();
    for (let f = 0; f < this.frames; f++) {
      const p = this.poses, a = 7 * (f * this.count + body - 1);
      v.fromArray(at).applyQuaternion(q.set(p[a + 4], p[a + 5], p[a + 6], p[a + 3]));
      out.set([v.x + p[a], v.y + p[a + 1], v.z + p[a + 2]], 3 * f);
    }
    return out;
  }

  // The same at any times.
  pathAt(times, body, at) {
    const out = new Float32Array(3 * times.length), pose = new Float64Array(7);
    const v = new THREE.Vector3(), q = new THREE.Quaternion();
    times.forEach((t, n) => {
      const { frame, part } = this.locate(t);
      this.#pose(this.#weights(frame, part), body - 1, pose);
      v.fromArray(at).applyQuaternion(q.set(pose[4], pose[5], pose[6], pose[3]).normalize());
      out.set([v.x + pose[0], v.y + pose[1], v.z + pose[2]], 3 * n);
    });
    return out;
  }

  // Numbers of one body's pose: a sum of those of frames; p is of unit length at frames alone.
  #pose(weights, b, out) {
    const { poses, count } = this;
    out.fill(0);
    for (const [f, weight] of weights) {
      const at = 7 * (f * count + b);
      for (let k = 0; k < 7; k++) out[k] += weight * poses[at + k];
    }
  }
}
