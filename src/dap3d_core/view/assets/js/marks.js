// Solids that ride on bodies, and spans between bodies: many alike are drawn at once.

// Of many alike each is small on the screen: they are made of fewer triangles.
const MANY = 120;

const SOLIDS = {
  sphere: (few) => (few ? new THREE.SphereGeometry(1, 28, 18) : new THREE.SphereGeometry(1, 10, 7)),
  cylinder: (few) => new THREE.CylinderGeometry(1, 1, 1, few ? 28 : 8).rotateX(Math.PI / 2),
  cone: (few) => new THREE.ConeGeometry(1, 1, few ? 32 : 10).rotateX(Math.PI / 2).translate(0, 0, 0.5),
  box: () => new THREE.BoxGeometry(1, 1, 1),
  ring: (few) => (few ? new THREE.TorusGeometry(1, 0.09, 14, 64) : new THREE.TorusGeometry(1, 0.09, 8, 24)),
};
const TURNS = 7, MANY_SPRINGS = 40;

const material = () => new THREE.MeshStandardMaterial({ roughness: 0.62, metalness: 0.04 });
// Ellipsoids of inertia stand for bodies without a form: what they surround is seen through them.
const TRANSLUCENT = { inertia: { transparent: true, opacity: 0.32, depthWrite: false } };
const threeQuaternion = (p) => new THREE.Quaternion(p[1], p[2], p[3], p[0]);

function instances(geometry, count) {
  const mesh = new THREE.InstancedMesh(geometry, material(), Math.max(count, 1));
  mesh.count = count;
  mesh.frustumCulled = false;
  return mesh;
}

class Marks {
  constructor(data, stage) {
    this.stage = stage;
    this.layers = {};
    this.batches = [];
    this.free = [];
    const groups = new Map();
    for (const [layer, kind, body, at, size, q, color, owner] of data.marks) {
      const key = `${layer} ${kind}`;
      if (!groups.has(key)) groups.set(key, []);
      const local = new THREE.Matrix4().compose(
        new THREE.Vector3().fromArray(at), threeQuaternion(q), new THREE.Vector3().fromArray(size));
      groups.get(key).push({ body, local, color, owner });
    }
    for (const [key, items] of groups) this.#batch(...key.split(" "), items);
    this.#spans(data.spans);
    for (const mesh of data.meshes) this.#mesh(mesh);
    for (const line of data.lines) this.#line(line);
  }

  #batch(layer, kind, items) {
    const mesh = instances(SOLIDS[kind](items.length < MANY), items.length);
    mesh.material.setValues(TRANSLUCENT[layer] ?? {});
    items.forEach((item, k) => mesh.setColorAt(k, new THREE.Color(item.color)));
    mesh.userData.owners = items.map((item) => item.owner);
    mesh.userData.layer = layer;
    this.batches.push({ mesh, items });
    this.#add(layer, mesh);
  }

  #add(layer, object) {
    (this.layers[layer] ??= []).push(object);
    this.stage.scene.add(object);
  }

  // Rods are one cylinder each, springs a helix of short ones.
  #spans(spans) {
    this.spans = [];
    const springs = spans.filter((s) => s.kind === "spring").length;
    this.perTurn = springs > MANY_SPRINGS ? 4 : 12;
    for (const layer of new Set(spans.map((s) => s.layer))) {
      const mine = spans.filter((s) => s.layer === layer);
      const pieces = mine.map((s) => (s.kind === "spring" ? this.perTurn * TURNS + 2 : 1));
      const mesh = instances(new THREE.CylinderGeometry(1, 1, 1, springs > MANY_SPRINGS ? 6 : 10).rotateX(Math.PI / 2),
        pieces.reduce((a, b) => a + b, 0));
      mesh.userData.owners = [];
      mesh.userData.layer = layer;
      mine.forEach((span, k) => {
        const first = mesh.userData.owners.length;
        for (let n = 0; n < pieces[k]; n++) {
          mesh.setColorAt(first + n, new THREE.Color(span.color));
          mesh.userData.owners.push(span.owner);
        }
        this.spans.push({ ...span, mesh, first });
      });
      this.#add(layer, mesh);
    }
  }

  #mesh(item) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(float32(item.vertices), 3));
    geometry.setIndex(new THREE.BufferAttribute(uint32(item.triangles), 1));
    geometry.computeVertexNormals();
    const look = material();
    look.color.set(item.color);
    look.flatShading = true;
    look.side = THREE.DoubleSide;
    const mesh = new THREE.Mesh(geometry, look);
    const s = item.scale;
    const local = new THREE.Matrix4().compose(
      new THREE.Vector3().fromArray(item.at), threeQuaternion(item.q), new THREE.Vector3(s, s, s));
    this.#ride(mesh, item, local);
  }

  #line(item) {
    const geometry = new THREE.LineGeometry();
    geometry.setPositions(item.points.flat());
    const line = new THREE.Line2(geometry, new THREE.LineMaterial({ color: item.color, linewidth: 2.5 }));
    this.#ride(line, item, new THREE.Matrix4());
  }

  #ride(object, item, local) {
    object.matrixAutoUpdate = false;
    object.frustumCulled = false;
    object.userData.owners = [item.owner];
    object.userData.layer = "shapes";
    this.free.push({ object, body: item.body, local });
    this.#add("shapes", object);
  }

  update() {
    const { matrices } = this.stage, whole = new THREE.Matrix4();
    for (const { mesh, items } of this.batches) {
      if (!mesh.visible) continue;
      items.forEach((item, k) => {
        whole.multiplyMatrices(matrices[item.body], item.local).toArray(mesh.instanceMatrix.array, 16 * k);
      });
      mesh.instanceMatrix.needsUpdate = true;
    }
    for (const { object, body, local } of this.free) object.matrix.multiplyMatrices(matrices[body], local);
    for (const span of this.spans) if (span.mesh.visible) this.#stretch(span);
  }

  #stretch(span) {
    const from = new THREE.Vector3().fromArray(span.start[1]).applyMatrix4(this.stage.matrices[span.start[0]]);
    const to = new THREE.Vector3().fromArray(span.end[1]).applyMatrix4(this.stage.matrices[span.end[0]]);
    const points = span.kind === "spring" ? this.#helix(from, to, span.radius) : [from, to];
    const radius = span.kind === "spring" ? 0.2 * span.radius : span.radius;
    const matrix = new THREE.Matrix4();
    for (let k = 1; k < points.length; k++) {
      between(points[k - 1], points[k], radius, matrix).toArray(span.mesh.instanceMatrix.array, 16 * (span.first + k - 1));
    }
    span.mesh.instanceMatrix.needsUpdate = true;
  }

  // Straight ends of an eighth of the length, and TURNS turns between them.
  #helix(from, to, radius) {
    const along = to.clone().sub(from), [u, v] = normals(along);
    const points = [from], steps = this.perTurn * TURNS;
    for (let k = 0; k <= steps; k++) {
      const angle = (2 * Math.PI * k) / this.perTurn;
      const out = radius * Math.min(1, 4 * k / steps, 4 * (1 - k / steps));
      points.push(from.clone().addScaledVector(along, 0.125 + (0.75 * k) / steps)
        .addScaledVector(u, out * Math.cos(angle)).addScaledVector(v, out * Math.sin(angle)));
    }
    points.push(to);
    return points;
  }

  show(layer, visible) {
    for (const object of this.layers[layer] ?? []) object.visible = visible;
    this.update();
  }

  // Owner and layer of what a ray meets first.
  pick(raycaster) {
    const objects = Object.values(this.layers).flat().filter((o) => o.visible && !o.isLine2);
    for (const object of objects) if (object.isInstancedMesh) object.computeBoundingSphere();
    const [hit] = raycaster.intersectObjects(objects, false);
    if (!hit) return null;
    return { layer: hit.object.userData.layer, name: hit.object.userData.owners[hit.instanceId ?? 0] };
  }
}

// Two unit vectors normal to a direction and to one another.
function normals(direction) {
  const side = Math.abs(direction.x) < 0.6 * direction.length() ? new THREE.Vector3(1, 0, 0) : new THREE.Vector3(0, 1, 0);
  const u = new THREE.Vector3().crossVectors(direction, side).normalize();
  return [u, new THREE.Vector3().crossVectors(direction, u).normalize()];
}

const Z = new THREE.Vector3(0, 0, 1);

// The matrix of a unit cylinder along z that is to lie between two places.
function between(from, to, radius, matrix) {
  const along = to.clone().sub(from), length = along.length();
  const q = new THREE.Quaternion();
  if (length > 0) q.setFromUnitVectors(Z, along.multiplyScalar(1 / length));
  const middle = from.clone().add(to).multiplyScalar(0.5);
  return matrix.compose(middle, q, new THREE.Vector3(radius, radius, length));
}
