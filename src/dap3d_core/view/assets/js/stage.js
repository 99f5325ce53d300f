// Canvas, camera, light, the ground grid and the arrow of gravity.

const THEMES = {
  light: { sky: "#f3f5f7", grid: "#d3d9e0", strong: "#b4bdc7", gravity: "#5d6875" },
  dark: { sky: "#12161b", grid: "#262d35", strong: "#3a444f", gravity: "#9aa6b2" },
};

class Stage {
  constructor(data, canvas) {
    this.about = data.stage;
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.scene = new THREE.Scene();
    this.up = new THREE.Vector3().fromArray(data.stage.up);
    this.center = new THREE.Vector3().fromArray(data.stage.center);
    this.size = data.stage.size;
    this.camera = new THREE.PerspectiveCamera(32, 1, this.size / 500, this.size * 50);
    this.camera.up.copy(this.up);
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    this.controls.maxDistance = this.size * 20;
    this.controls.minDistance = this.size / 200;
    this.matrices = Array.from({ length: data.bodies.length + 1 }, () => new THREE.Matrix4());
    this.#light();
    this.#ground();
    this.#gravity();
    this.standing = new Set(this.scene.children);
    this.resize();
    this.fit();
    this.controls.addEventListener("change", () => this.onchange?.());
  }

  // Take away what was drawn of a motion; lights, ground and gravity stay.
  clear() {
    for (const object of [...this.scene.children]) {
      if (this.standing.has(object)) continue;
      this.scene.remove(object);
      object.geometry?.dispose();
      object.material?.dispose();
    }
  }

  #light() {
    const sky = new THREE.HemisphereLight("#ffffff", "#8a8f98", 1.7);
    sky.position.copy(this.up);
    this.scene.add(sky);
    this.lamp = new THREE.DirectionalLight("#ffffff", 1.5);
    this.camera.add(this.lamp);
    this.lamp.position.set(-0.6, 1.0, 0.6);
    this.lamp.target = this.camera;
    this.scene.add(this.camera);
  }

  // Two unit vectors of the ground plane, along axes where up is one.
  plane() {
    const axes = [new THREE.Vector3(1, 0, 0), new THREE.Vector3(0, 1, 0), new THREE.Vector3(0, 0, 1)];
    axes.sort((a, b) => Math.abs(a.dot(this.up)) - Math.abs(b.dot(this.up)));
    const first = axes[0].addScaledVector(this.up, -axes[0].dot(this.up)).normalize();
    return [first, new THREE.Vector3().crossVectors(this.up, first)];
  }

  #ground() {
    const [a, b] = this.plane();
    const half = [a, b].map((v) => {
      const e = this.about.extent;
      return Math.max(0.5 * (Math.abs(v.x) * e[0] + Math.abs(v.y) * e[1] + Math.abs(v.z) * e[2]), 0.12 * this.size);
    });
    this.spacing = niceBelow(this.size / 8);
    const range = [a, b].map((v, k) => {
      const c = this.center.dot(v), reach = 1.35 * half[k];
      return [Math.floor((c - reach) / this.spacing), Math.ceil((c + reach) / this.spacing)];
    });
    const base = this.up.clone().multiplyScalar(this.about.ground);
    const lines = { grid: [], strong: [] };
    const line = (into, u, v) => [u, v].forEach(([x, y]) => {
      into.push(...base.clone().addScaledVector(a, x * this.spacing).addScaledVector(b, y * this.spacing).toArray());
    });
    for (let k = range[0][0]; k <= range[0][1]; k++) line(k % 5 ? lines.grid : lines.strong, [k, range[1][0]], [k, range[1][1]]);
    for (let k = range[1][0]; k <= range[1][1]; k++) line(k % 5 ? lines.grid : lines.strong, [range[0][0], k], [range[0][1], k]);
    this.grid = new THREE.Group();
    this.gridLines = {};
    for (const [name, points] of Object.entries(lines)) {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
      this.gridLines[name] = new THREE.LineBasicMaterial();
      this.grid.add(new THREE.LineSegments(geometry, this.gridLines[name]));
    }
    this.scene.add(this.grid);
  }

  // Stands on the ground left of the motion; its label says how strong gravity is.
  #gravity() {
    const g = this.about.gravity;
    this.gravity = new THREE.Group();
    this.gravityMaterial = new THREE.MeshBasicMaterial();
    if (g) {
      const length = 0.11 * this.size, radius = 0.0035 * this.size;
      const shaft = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, 0.75 * length, 12), this.gravityMaterial);
      shaft.position.y = 0.625 * length;
      const head = new THREE.Mesh(new THREE.ConeGeometry(3 * radius, 0.25 * length, 16), this.gravityMaterial);
      head.position.y = 0.125 * length;
      head.rotation.x = Math.PI;
      this.gravity.add(shaft, head);
      const eye = new THREE.Vector3().fromArray(this.about.eye), e = this.about.extent;
      const right = new THREE.Vector3().crossVectors(this.up, eye).normalize();
      const half = 0.5 * (Math.abs(right.x) * e[0] + Math.abs(right.y) * e[1] + Math.abs(right.z) * e[2]);
      this.gravity.position.copy(this.center).addScaledVector(right, -half - 0.04 * this.size)
        .addScaledVector(this.up, this.about.ground - this.center.dot(this.up));
      this.gravityTip = this.gravity.position.clone().addScaledVector(this.up, length);
      this.setGravity(g);
    }
    this.scene.add(this.gravity);
  }

  // How strong it is and where it points, which may differ from point to point of a sweep.
  setGravity(g) {
    const size = Math.hypot(...(g ?? [0]));
    this.gravityText = g ? `g ${short(size)} m/s\u00b2` : "";
    this.gravity.scale.setScalar(size > 0 ? 1 : 1e-9);
    if (size > 0) this.gravity.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3().fromArray(g).divideScalar(-size));
  }

  setTheme(name) {
    const theme = THEMES[name];
    this.scene.background = new THREE.Color(theme.sky);
    this.gridLines.grid.color.set(theme.grid);
    this.gridLines.strong.color.set(theme.strong);
    this.gravityMaterial.color.set(theme.gravity);
  }

  // Look at the whole motion, from a good side, as near as it fits, in the middle.
  fit() {
    const eye = new THREE.Vector3().fromArray(this.about.eye);
    const right = new THREE.Vector3().crossVectors(this.up, eye).normalize();
    const top = new THREE.Vector3().crossVectors(eye, right);
    const tall = Math.tan((this.camera.fov * Math.PI) / 360) * 0.84, wide = tall * this.camera.aspect;
    const places = this.about.farthest.map((p) => new THREE.Vector3().fromArray(p));
    if (this.gravityTip) places.push(this.gravityTip, this.gravity.position);
    const target = this.center.clone(), from = new THREE.Vector3();
    let distance = 0;
    for (let round = 0; round < 4; round++) {
      distance = 0.05 * this.size;
      for (const place of places) {
        from.copy(place).sub(target);
        distance = Math.max(distance, from.dot(eye) + Math.max(Math.abs(from.dot(right)) / wide, Math.abs(from.dot(top)) / tall));
      }
      for (const axis of [right, top]) { // the middle of what is seen along this axis
        const seen = places.map((place) => { from.copy(place).sub(target); return from.dot(axis) / (distance - from.dot(eye)); });
        target.addScaledVector(axis, 0.5 * distance * (Math.min(...seen) + Math.max(...seen)));
      }
    }
    this.controls.target.copy(target);
    this.camera.position.copy(target).addScaledVector(eye, distance);
    this.controls.update();
  }

  resize() {
    const box = this.canvas.parentElement.getBoundingClientRect();
    this.width = Math.max(box.width, 1);
    this.height = Math.max(box.height, 1);
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(this.width, this.height, false);
    this.camera.aspect = this.width / this.height;
    this.camera.updateProjectionMatrix();
  }

  // Matrices of the bodies from a placed motion; everything that is drawn hangs on them.
  place(motion) {
    const r = new THREE.Vector3(), q = new THREE.Quaternion(), one = new THREE.Vector3(1, 1, 1);
    for (let b = 0; b < this.matrices.length; b++) {
      r.fromArray(motion.r, 3 * b);
      q.set(motion.q[4 * b + 1], motion.q[4 * b + 2], motion.q[4 * b + 3], motion.q[4 * b]);
      this.matrices[b].compose(r, q, one);
    }
  }

  // Move camera and target along with something.
  shift(by) {
    this.camera.position.add(by);
    this.controls.target.add(by);
  }

  // Pixels that a metre takes up at the distance of what is looked at.
  get pixelsPerMetre() {
    const distance = this.camera.position.distanceTo(this.controls.target);
    return this.height / (2 * distance * Math.tan((this.camera.fov * Math.PI) / 360));
  }

  // Where a place is on the screen, pixels; z beyond 1 is behind the eye.
  project(place) {
    const v = place.clone().project(this.camera);
    return { x: (0.5 + 0.5 * v.x) * this.width, y: (0.5 - 0.5 * v.y) * this.height, z: v.z };
  }

  render() {
    this.renderer.render(this.scene, this.camera);
  }
}
