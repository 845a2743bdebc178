/**
 * The mechanism in space: solids that go with their links, arrows, labels, a camera that turns about it.
 */
import * as THREE from "./vendor.js";
import { unpacked } from "./data.js";
import { placed } from "./labels.js";

/** @typedef {import("./data.js").Figure} Figure */
/** @typedef {import("./data.js").Arrow} Arrow */
/** @typedef {{ ink: string, muted: string, ground: string, body: string, load: string, force: string, moment: string, mark: string }} Colours */
/** @typedef {{ root: THREE.Group, whole: THREE.Mesh, striped: THREE.Group, heads: THREE.Mesh[] }} ArrowParts */

/** @typedef {{ solid?: [string, number], line?: [string, number, number] }} Paint */

const Z = new THREE.Vector3(0, 0, 1);
const STRIPES = 4;
const NEAREST = 26;

/** @returns {boolean} */
export function canDraw() {
  try {
    return document.createElement("canvas").getContext("webgl2") !== null;
  } catch {
    return false;
  }
}

export class Stage {
  /**
   * @param {HTMLElement} box in which it is drawn
   * @param {Colours} colours
   * @param {(pair: number) => void} onPick
   */
  constructor(box, colours, onPick) {
    this.box = box;
    this.colours = colours;
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
    this.canvas = this.renderer.domElement;
    this.overlay = document.createElement("div");
    this.overlay.className = "labels";
    this.overlay.setAttribute("aria-hidden", "true");
    box.append(this.canvas, this.overlay);
    this.scene = new THREE.Scene();
    this.camera = new THREE.OrthographicCamera();
    const lamp = new THREE.DirectionalLight(0xffffff, 1.6);
    this.camera.add(lamp);
    lamp.position.set(0.4, 0.8, 1);
    this.scene.add(new THREE.AmbientLight(0xffffff, 1.5), this.camera);
    /** @type {THREE.Group[]} */
    this.frames = [];
    this.arrows = new THREE.Group();
    this.marks = new THREE.Group();
    this.scene.add(this.arrows, this.marks);
    /** @type {ArrowParts[]} */
    this.pool = [];
    /** @type {{ node: HTMLElement, label: import("./data.js").Label, width: number, height: number }[]} */
    this.labels = [];
    this.figure = /** @type {Figure | null} */ (null);
    this.selected = -1;
    /** @type {Set<number>} */
    this.open = new Set();
    this.asked = 0;
    /** @type {THREE.Object3D[]} */
    this.added = [];
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener("change", () => this.invalidate());
    this.watch = new ResizeObserver(() => this.resize());
    this.watch.observe(box);
    this.listen(onPick);
  }

  /**
   * Clicks choose the nearest pair; keys turn, zoom and fit.
   * @param {(pair: number) => void} onPick
   */
  listen(onPick) {
    let from = [0, 0];
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", "The mechanism in three dimensions. Arrow keys turn it, plus and minus zoom, 0 shows all of it.");
    this.canvas.addEventListener("pointerdown", (event) => (from = [event.clientX, event.clientY]));
    this.canvas.addEventListener("pointerup", (event) => {
      if (Math.hypot(event.clientX - from[0], event.clientY - from[1]) > 5) return;
      const bounds = this.canvas.getBoundingClientRect();
      const pair = this.nearest(event.clientX - bounds.left, event.clientY - bounds.top);
      if (pair >= 0) onPick(pair);
    });
    /** @type {Record<string, () => void>} */
    const keys = {
      ArrowLeft: () => this.turn(-0.15, 0),
      ArrowRight: () => this.turn(0.15, 0),
      ArrowUp: () => this.turn(0, 0.15),
      ArrowDown: () => this.turn(0, -0.15),
      "+": () => this.zoom(1.15),
      "=": () => this.zoom(1.15),
      "-": () => this.zoom(1 / 1.15),
      0: () => this.fit(),
    };
    this.canvas.addEventListener("keydown", (event) => {
      const act = keys[event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      act();
    });
  }

  /** @param {Colours} colours */
  recolour(colours) {
    this.colours = colours;
    if (this.figure) this.show(this.figure);
  }

  /**
   * Another figure; the camera stays.
   * @param {Figure} figure
   */
  show(figure) {
    for (const group of this.frames) dispose(group);
    this.figure = figure;
    this.frames = Array.from({ length: figure.frames.shape[0] }, () => {
      const group = new THREE.Group();
      group.matrixAutoUpdate = false;
      this.scene.add(group);
      return group;
    });
    for (const piece of figure.pieces) this.frames[piece.frame].add(...this.solids(piece));
    this.overlay.replaceChildren();
    this.labels = figure.labels.map((label) => {
      const node = document.createElement("span");
      node.className = `label ${label.kind}`;
      node.textContent = label.text;
      this.overlay.append(node);
      return { node, label, width: 0, height: 0 };
    });
    for (const label of this.labels) [label.width, label.height] = [label.node.offsetWidth, label.node.offsetHeight];
    this.stand();
    this.invalidate();
  }

  /**
   * Pieces that are shown for a while.
   * @param {import("./data.js").Piece[]} pieces
   */
  add(pieces) {
    for (const solid of this.added) dispose(solid);
    this.added = pieces.flatMap((piece) => {
      const solids = this.solids(piece);
      this.frames[piece.frame].add(...solids);
      return solids;
    });
    this.invalidate();
  }

  /** Everything where the figure stands. */
  stand() {
    if (!this.figure) return;
    this.pose(unpacked(this.figure.frames), this.frames.map((_, i) => i));
  }

  /**
   * How a piece is painted: its solid, a colour and how much of it is seen; its lines, with their width; nothing where it is left out.
   * @param {import("./data.js").Piece} piece
   * @returns {Paint}
   */
  paint(piece) {
    const { ink, muted, ground, body, load, mark } = this.colours;
    const own = piece.colour || ink;
    /** @type {Record<string, Paint>} */
    const ways = {
      wheel: { solid: [tint(own), 1], line: [own, 1, 1.2] },
      face: { line: [own, 1, 3] },
      roller: { solid: [body, 1], line: [ink, 1, 1.2] },
      strand: { solid: [ink, 1] },
      link: { solid: [own, 1] },
      plate: { solid: [own, 0.28] },
      guide: { solid: [own, 0.22], line: [own, 0.9, 1] },
      body: { solid: [body, 1], line: [ink, 1, 1.2] },
      dark: { solid: [ink, 1] },
      axis: { line: [muted, 0.9, 1] },
      tie: { line: [own, 0.7, 1] },
      foot: { solid: [ground, 0.35], line: [ground, 1, 1] },
      spring: { solid: [body, 1], line: [ink, 1, 1.8] },
      load: { solid: [load, 1], line: [load, 1, 2.6] },
      drive: { solid: [mark, 1], line: [mark, 1, 2] },
    };
    return ways[piece.role] ?? { solid: [own, 1], line: [own, 1, 1] };
  }

  /**
   * Solids, lines and points of one piece.
   * @param {import("./data.js").Piece} piece
   */
  solids(piece) {
    const { solid, line } = this.paint(piece);
    const seen = piece.dashed ? 0.4 : 1;
    const at = new THREE.BufferAttribute(unpacked(piece.vertices), 3);
    const geometry = new THREE.BufferGeometry().setAttribute("position", at);
    const out = [];
    if (piece.triangles.length && solid) {
      const [color, opacity] = [solid[0], solid[1] * seen];
      const flat = geometry.clone().setIndex(piece.triangles).toNonIndexed();
      flat.computeVertexNormals();
      const thin = opacity < 1;
      const material = new THREE.MeshLambertMaterial({ color, opacity, transparent: thin, depthWrite: !thin, flatShading: true, side: THREE.DoubleSide });
      // lines on a solid would flicker in its faces
      Object.assign(material, { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
      out.push(new THREE.Mesh(flat, material));
    }
    if (piece.lines.length && line) {
      const ends = piece.lines.flatMap((i) => [at.getX(i), at.getY(i), at.getZ(i)]);
      out.push(lines(ends, line[0], line[1] * seen, line[2]));
    }
    if (!piece.lines.length && !piece.triangles.length) {
      const color = piece.role === "center" ? piece.colour || this.colours.ink : this.colours.ink;
      out.push(new THREE.Points(geometry, new THREE.PointsMaterial({ color, size: 7 * Math.min(devicePixelRatio, 2), sizeAttenuation: false })));
    }
    for (const one of out) one.userData = { scales: piece.scales };
    return out;
  }

  /** Details where they are large enough to be seen, else what stands for them. */
  detail() {
    const scale = (this.box.clientHeight * this.camera.zoom) / (this.camera.top - this.camera.bottom);
    for (const group of this.frames) {
      for (const solid of group.children) {
        const [from, to] = solid.userData["scales"];
        solid.visible = scale >= from && (!to || scale < to);
      }
    }
  }

  /**
   * Frames where maps say; a frame without numbers is not seen.
   * @param {ArrayLike<number>} maps (frames, 12)
   * @param {number[]} frames
   */
  pose(maps, frames) {
    frames.forEach((frame, i) => {
      const group = this.frames[frame];
      const [a, b, c, x, d, e, f, y, g, h, k, z] = Array.from({ length: 12 }, (_, j) => maps[12 * i + j]);
      group.visible = Number.isFinite(a + x + y + z);
      group.matrix.set(a, b, c, x, d, e, f, y, g, h, k, z, 0, 0, 0, 1);
      group.updateMatrixWorld(true);
    });
    this.invalidate();
  }

  /**
   * Where a point of a frame is now.
   * @param {number} frame
   * @param {number[]} at
   */
  place(frame, at) {
    return new THREE.Vector3(at[0], at[1], at[2]).applyMatrix4(this.frames[frame].matrixWorld);
  }

  /**
   * Arrows: forces with one head, moments with two; striped where a part is not known.
   * @param {{ at: number[], vector: number[], moment: boolean, open: boolean }[]} arrows lengths in those of the figure
   */
  point(arrows) {
    const size = this.figure?.size ?? 1;
    while (this.pool.length < arrows.length) this.pool.push(this.arrow());
    this.pool.forEach((parts, i) => {
      const arrow = arrows[i];
      const length = arrow ? Math.hypot(...arrow.vector) : 0;
      parts.root.visible = length > 1e-6 * size;
      if (!parts.root.visible) return;
      const colour = arrow.moment ? this.colours.moment : this.colours.force;
      const direction = new THREE.Vector3(arrow.vector[0], arrow.vector[1], arrow.vector[2]).normalize();
      parts.root.position.set(arrow.at[0], arrow.at[1], arrow.at[2]);
      parts.root.quaternion.setFromUnitVectors(Z, direction);
      const head = Math.min(0.04 * size, 0.5 * length);
      const thick = 0.005 * size;
      parts.whole.visible = !arrow.open;
      parts.striped.visible = arrow.open;
      for (const shaft of [parts.whole, parts.striped]) shaft.scale.set(thick, thick, length - 0.5 * head);
      parts.heads.forEach((cone, j) => {
        cone.visible = j === 0 || arrow.moment;
        cone.scale.set(0.38 * head, 0.38 * head, head);
        cone.position.z = length - 0.5 * head - 0.75 * j * head;
      });
      parts.root.traverse((node) => {
        if (node instanceof THREE.Mesh) node.material.color.set(colour);
      });
    });
    this.invalidate();
  }

  /** @returns {ArrowParts} */
  arrow() {
    // seen through what they act on
    const material = () => new THREE.MeshBasicMaterial({ depthTest: false, transparent: true });
    const rod = new THREE.CylinderGeometry(1, 1, 1, 10).rotateX(Math.PI / 2).translate(0, 0, 0.5);
    const cone = new THREE.ConeGeometry(1, 1, 14).rotateX(Math.PI / 2);
    const root = new THREE.Group();
    const whole = new THREE.Mesh(rod, material());
    const striped = new THREE.Group();
    for (let i = 0; i < STRIPES; i++) {
      const stripe = new THREE.Mesh(rod, material());
      stripe.scale.z = 0.6 / STRIPES;
      stripe.position.z = i / STRIPES;
      striped.add(stripe);
    }
    const heads = [new THREE.Mesh(cone, material()), new THREE.Mesh(cone, material())];
    root.add(whole, striped, ...heads);
    root.traverse((node) => (node.renderOrder = 2));
    this.arrows.add(root);
    return { root, whole, striped, heads };
  }

  /**
   * Rings about pairs that are meant, and lines of axes.
   * @param {number[]} pairs
   * @param {number[][]} axes
   */
  mark(pairs, axes) {
    dispose(this.marks);
    this.marks = new THREE.Group();
    this.scene.add(this.marks);
    const { size, symbol } = this.figure ?? { size: 1, symbol: 0.03 };
    for (const pair of pairs) {
      const { frame, at } = /** @type {Figure} */ (this.figure).pairs[pair];
      const ring = new THREE.Mesh(new THREE.TorusGeometry(1.9 * symbol, 0.2 * symbol, 8, 36), new THREE.MeshBasicMaterial({ color: this.colours.mark }));
      ring.userData = { frame, at };
      this.marks.add(ring);
    }
    for (const [x, y, z, u, v, w] of axes) {
      const ends = [x - 0.7 * size * u, y - 0.7 * size * v, z - 0.7 * size * w, x + 0.7 * size * u, y + 0.7 * size * v, z + 0.7 * size * w];
      this.marks.add(lines(ends, this.colours.mark, 1, 1.5));
    }
    this.invalidate();
  }

  /** All of it on the screen, seen as it is meant. */
  fit() {
    if (!this.figure) return;
    const { size, center, up, look } = this.figure;
    this.camera.up.set(up[0], up[1], up[2]);
    this.controls.target.set(center[0], center[1], center[2]);
    this.camera.position.set(center[0] + 4 * size * look[0], center[1] + 4 * size * look[1], center[2] + 4 * size * look[2]);
    this.camera.near = 0.01 * size;
    this.camera.far = 12 * size;
    this.camera.zoom = 1;
    this.resize();
    this.controls.update();
  }

  /**
   * @param {number} across
   * @param {number} over
   */
  turn(across, over) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const up = this.camera.up.clone().normalize();
    offset.applyAxisAngle(up, across);
    const side = up.clone().cross(offset).normalize();
    const tilted = offset.clone().applyAxisAngle(side, -over);
    if (Math.abs(tilted.clone().normalize().dot(up)) < 0.999) offset.copy(tilted);
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.invalidate();
  }

  /** @param {number} factor */
  zoom(factor) {
    this.camera.zoom = Math.min(Math.max(this.camera.zoom * factor, 0.1), 30);
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.invalidate();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.box;
    if (!width || !height || !this.figure) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    const [wide, high] = this.figure.span;
    const over = Math.max(high, (wide * height) / width) / 2;
    const across = (over * width) / height;
    [this.camera.left, this.camera.right, this.camera.top, this.camera.bottom] = [-across, across, over, -over];
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }

  /**
   * The pair nearest to a point of the screen, -1 where none is near.
   * @param {number} x
   * @param {number} y
   */
  nearest(x, y) {
    let [best, distance] = [-1, NEAREST];
    this.figure?.pairs.forEach((pair, i) => {
      const at = this.onScreen(this.place(pair.frame, pair.at));
      const away = Math.hypot(at.x - x, at.y - y);
      if (away < distance) [best, distance] = [i, away];
    });
    return best;
  }

  /** @param {THREE.Vector3} at */
  onScreen(at) {
    const { clientWidth: width, clientHeight: height } = this.box;
    const seen = at.clone().project(this.camera);
    return { x: ((seen.x + 1) / 2) * width, y: ((1 - seen.y) / 2) * height };
  }

  invalidate() {
    if (!this.asked) this.asked = requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.asked = 0;
    this.camera.updateMatrixWorld();
    for (const ring of this.marks.children) {
      if (!("frame" in ring.userData)) continue;
      ring.position.copy(this.place(ring.userData["frame"], ring.userData["at"]));
      ring.quaternion.copy(this.camera.quaternion);
    }
    this.detail();
    this.renderer.render(this.scene, this.camera);
    const { clientWidth: width, clientHeight: height } = this.box;
    const wishes = this.labels.map(({ label, width: w, height: h }) => {
      const { x, y } = this.onScreen(this.place(label.frame, label.at));
      const weight = label.pair >= 0 && label.pair === this.selected ? 3 : label.kind === "pair" ? 2 : 1;
      return { x, y, width: w, height: h, weight };
    });
    placed(wishes, width, height).forEach((place, i) => {
      const { node, label } = this.labels[i];
      node.style.visibility = place ? "visible" : "hidden";
      if (place) node.style.transform = `translate(${place.left}px, ${place.top}px)`;
      node.classList.toggle("open", this.open.has(label.pair));
      node.classList.toggle("chosen", label.pair >= 0 && label.pair === this.selected);
    });
  }

  /** Gives everything back. */
  close() {
    this.watch.disconnect();
    if (this.asked) cancelAnimationFrame(this.asked);
    this.controls.dispose();
    for (const group of [...this.frames, this.marks, this.arrows]) dispose(group);
    this.renderer.dispose();
    this.canvas.remove();
    this.overlay.remove();
  }
}

/**
 * Segments of a width in pixels.
 * @param {number[]} ends
 * @param {string} color
 * @param {number} opacity
 * @param {number} linewidth
 */
function lines(ends, color, opacity, linewidth) {
  const material = new THREE.LineMaterial({ color, opacity, transparent: opacity < 1, linewidth });
  return new THREE.LineSegments2(new THREE.LineSegmentsGeometry().setPositions(ends), material);
}

/**
 * A color, mixed with white.
 * @param {string} color of six hexadecimal digits
 */
function tint(color) {
  const parts = [1, 3, 5].map((i) => Math.round(255 - 0.28 * (255 - parseInt(color.slice(i, i + 2), 16))));
  return `#${parts.map((part) => part.toString(16).padStart(2, "0")).join("")}`;
}

/** @param {THREE.Object3D} group */
function dispose(group) {
  group.removeFromParent();
  group.traverse((node) => {
    if (!(node instanceof THREE.Mesh || node instanceof THREE.Points)) return;
    node.geometry.dispose();
    node.material.dispose();
  });
}
