/**
 * What is seen and chosen: the mechanism, what it can do, the numbers of a pair, curves, one slider for all.
 */
import { Curves } from "./charts.js";
import { advanced, between, unpacked } from "./data.js";
import { coloursOf, elements, made, table } from "./dom.js";
import { canDraw, Stage } from "./stage.js";

/** @typedef {import("./data.js").Data} Data */
/** @typedef {import("./data.js").Item} Item */
/** @typedef {{ frames: number[], values: Float32Array, count: number, kind: string, places?: string[] }} Moving */

/** Seconds of a whole cycle, of a way to one side, of a turn. */
const SECONDS = { cycle: 6, swing: 2, spin: 4 };
/** Length of the longest arrow in sizes of the figure. */
const LONGEST = 0.17;
const NO_DRAWING = "This browser cannot draw in three dimensions (WebGL is off); the still pictures and all numbers are here.";

class View {
  /**
   * @param {HTMLElement} root
   * @param {Data} data
   */
  constructor(root, data) {
    this.root = root;
    this.data = data;
    this.item = data.items[0];
    this.home = -1;
    this.cycle = data.cycle;
    this.frame = 0;
    this.direction = 1;
    this.playing = 0;
    this.pair = -1;
    this.after = false;
    /** @type {Moving | null} */
    this.motion = null;
    this.still = matchMedia("(prefers-reduced-motion: reduce)");
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.forces = (data.cycle?.forces ?? []).map(({ pair, at, force, moment, open }) => ({ pair, open: open.length > 0, at: unpacked(at), force: unpacked(force), moment: unpacked(moment) }));
    this.longest = { force: greatest(this.forces.map((f) => f.force)), moment: greatest(this.forces.map((f) => f.moment)) };
    /** @type {Curves[]} */
    this.curves = [];
    this.ui = elements(root);
    /** @type {Map<Item, HTMLButtonElement>} */
    this.buttons = new Map();
    this.fill();
    this.stage = canDraw() ? new Stage(this.ui.stage, coloursOf(root), (pair) => this.choosePair(pair)) : null;
    if (!this.stage) this.ui.stage.append(made("p", { className: "missing", textContent: NO_DRAWING }));
    root.classList.toggle("flat", !this.stage);
    this.listen();
    this.choose(this.item, false);
  }

  listen() {
    const { ui } = this;
    this.onTheme = () => this.recolour();
    this.dark.addEventListener("change", this.onTheme);
    ui.play.addEventListener("click", () => (this.playing ? this.pause() : this.start()));
    ui.slider.addEventListener("input", () => this.seek(Number(ui.slider.value)));
    ui.fit.addEventListener("click", () => this.stage?.fit());
    ui.larger.addEventListener("click", () => this.stage?.zoom(1.25));
    ui.smaller.addEventListener("click", () => this.stage?.zoom(0.8));
    ui.names.input.addEventListener("change", () => this.root.classList.toggle("unnamed", !ui.names.input.checked));
    ui.forces.input.addEventListener("change", () => this.draw());
    ui.select.addEventListener("change", () => this.choosePair(Number(ui.select.value)));
  }

  /** Buttons for all there is to show. */
  fill() {
    /** @type {Map<string, Item[]>} */
    const groups = new Map();
    for (const item of this.data.items) groups.set(item.group, [...(groups.get(item.group) ?? []), item]);
    for (const [group, items] of groups) {
      const list = made("ul");
      for (const item of items) {
        const button = made("button", { type: "button", textContent: item.title });
        button.addEventListener("click", () => this.choose(item, true));
        this.buttons.set(item, button);
        list.append(made("li", {}, button));
      }
      this.ui.choices.append(made("h3", { textContent: group }), list);
    }
    if (this.data.note) this.ui.choices.append(made("p", { className: "note", textContent: this.data.note }));
    this.ui.forces.label.hidden = !this.forces.length;
  }

  /** Another mechanism than before: all of it is seen, and its pairs have names of their own. */
  arrive() {
    this.home = this.item.figure;
    const { pairs } = this.data.figures[this.home];
    this.ui.select.replaceChildren(...pairs.map((pair, i) => made("option", { value: String(i), textContent: `${pair.name} (${pair.type}), ${pair.a} \u2013 ${pair.b}` })));
    this.stage?.fit();
    this.choosePair(Math.min(Math.max(this.pair, 0), pairs.length - 1));
  }

  recolour() {
    this.stage?.recolour(coloursOf(this.root));
    this.stand();
    this.redraw();
    this.show();
  }

  /** The curves anew. */
  redraw() {
    for (const curve of this.curves) curve.close();
    const { cycle } = this;
    if (!cycle) return;
    const colours = coloursOf(this.root);
    const all = /** @type {const} */ ([[this.ui.efforts, cycle.efforts], [this.ui.charts, cycle.pairs[this.pair] ?? []]]);
    this.curves = all.flatMap(([box, charts]) => charts.map((chart) => new Curves(box, chart, cycle, colours, (frame) => this.jump(frame))));
    for (const curve of this.curves) curve.show(this.cycling ? Math.round(this.frame) : 0);
  }

  /**
   * Something else is shown.
   * @param {Item} item
   * @param {boolean} play
   */
  choose(item, play) {
    this.pause();
    this.item = item;
    this.after = false;
    this.direction = 1;
    for (const [other, button] of this.buttons) button.setAttribute("aria-pressed", String(other === item));
    this.fillSides();
    this.stand();
    const last = (this.motion?.count ?? 1) - 1;
    // a freedom begins in the middle, where the mechanism stands; at its end for those who want nothing to move
    const swings = this.motion?.kind === "swing" && !this.motion.places && item !== this.data.items[0];
    this.frame = swings ? (this.still.matches ? last : last / 2) : 0;
    this.ui.bar.hidden = !last;
    this.ui.slider.max = String(last);
    this.ui.slider.setAttribute("aria-label", `position: ${item.title}`);
    if (this.home !== item.figure) this.arrive();
    this.show();
    if (play && last && !this.still.matches) this.start();
  }

  /** The figure that belongs to what is chosen, as it stands. */
  stand() {
    const { item } = this;
    const after = this.after ? item.after : null;
    const figure = this.data.figures[after ? after.figure : item.figure];
    const motion = after ? null : item.motion;
    this.motion = motion && { frames: motion.frames, values: unpacked(motion.values), count: motion.values.shape[0], kind: motion.kind, places: motion.places };
    if (this.stage && this.stage.figure !== figure) this.stage.show(figure);
    else this.stage?.stand();
    this.stage?.add(after ? [] : item.pieces);
    this.stage?.mark(item.marked.filter((pair) => pair < figure.pairs.length), item.axes);
    this.ui.caption.textContent = after ? after.verdict : item.text;
  }

  /** Before and after an advice, with what changes. */
  fillSides() {
    const { after } = this.item;
    this.ui.sides.replaceChildren();
    if (!after) return;
    const buttons = ["Before", "After"].map((textContent) => made("button", { type: "button", textContent }));
    const side = (/** @type {number} */ chosen) => {
      this.after = chosen === 1;
      buttons.forEach((button, i) => button.setAttribute("aria-pressed", String(i === chosen)));
      this.stand();
      this.show();
    };
    buttons.forEach((button, i) => button.addEventListener("click", () => side(i)));
    buttons.forEach((button, i) => button.setAttribute("aria-pressed", String(i === 0)));
    this.ui.sides.append(made("div", { className: "switch" }, ...buttons), table(["", "before", "after"], after.rows));
  }

  start() {
    if (!this.motion || this.motion.count < 2) return;
    this.ui.play.textContent = "Pause";
    let last = performance.now();
    const step = (/** @type {number} */ now) => {
      if (!this.motion) return;
      const { count, kind } = this.motion;
      const seconds = SECONDS[/** @type {keyof typeof SECONDS} */ (kind)];
      [this.frame, this.direction] = advanced(this.frame, this.direction, ((now - last) / 1000 / seconds) * count, count, kind);
      last = now;
      this.show();
      this.playing = requestAnimationFrame(step);
    };
    this.playing = requestAnimationFrame(step);
  }

  pause() {
    if (this.playing) cancelAnimationFrame(this.playing);
    this.playing = 0;
    this.ui.play.textContent = "Play";
  }

  /** @param {number} frame */
  seek(frame) {
    this.pause();
    this.frame = frame;
    this.show();
  }

  /**
   * A position of the cycle, chosen on a curve.
   * @param {number} frame
   */
  jump(frame) {
    if (this.item !== this.data.items[0]) this.choose(this.data.items[0], false);
    this.seek(frame);
  }

  /** @param {number} pair */
  choosePair(pair) {
    const found = this.data.figures[this.item.figure].pairs[pair];
    if (!found) return;
    this.pair = pair;
    this.ui.select.value = String(pair);
    this.ui.facts.replaceChildren(...found.rows.flatMap(([name, text]) => [made("dt", { textContent: name }), made("dd", { textContent: text })]));
    if (this.stage) this.stage.selected = pair;
    this.redraw();
    this.show();
  }

  /** Is the cycle what is shown? */
  get cycling() {
    return this.item === this.data.items[0] && this.cycle !== null;
  }

  show() {
    const whole = Math.round(this.frame);
    const text = this.cycling ? this.cycle?.places[whole] : this.motion ? (this.motion.places?.[whole] ?? `${whole + 1} of ${this.motion.count}`) : "";
    this.ui.slider.value = String(whole);
    this.ui.place.textContent = text ?? "";
    this.ui.slider.setAttribute("aria-valuetext", text ?? "");
    if (this.cycling) for (const curve of this.curves) curve.show(whole);
    this.draw();
  }

  draw() {
    if (!this.stage) return;
    if (this.motion) this.stage.pose(between(this.motion.values, this.motion.frames.length, this.frame), this.motion.frames);
    this.stage.open = new Set(this.cycling && this.ui.forces.input.checked ? this.forces.filter((f) => f.open).map((f) => f.pair) : []);
    this.stage.point(this.cycling ? this.ofCycle() : this.ofItem());
  }

  /** Forces of the position shown; between two positions those of the nearer one. */
  ofCycle() {
    if (!this.ui.forces.input.checked) return [];
    const { size } = this.data.figures[0];
    const t = 3 * Math.round(this.frame);
    const at = (/** @type {Float32Array} */ rows) => [...rows.subarray(t, t + 3)];
    return this.forces.flatMap((f) => [
      { at: at(f.at), vector: scaled(at(f.force), (LONGEST * size) / this.longest.force), moment: false, open: f.open },
      { at: at(f.at), vector: scaled(at(f.moment), (0.7 * LONGEST * size) / this.longest.moment), moment: true, open: f.open },
    ]);
  }

  /** A self-stress, which an advice may have taken away. */
  ofItem() {
    if (this.after) return [];
    const { size } = this.data.figures[this.item.figure];
    const most = Math.max(...this.item.arrows.flatMap(({ force, moment }) => [Math.hypot(...force), Math.hypot(...moment)]), 0);
    return this.item.arrows.flatMap(({ at, force, moment, open }) => [
      { at, vector: scaled(force, (LONGEST * size) / most), moment: false, open },
      { at, vector: scaled(moment, (LONGEST * size) / most), moment: true, open },
    ]);
  }

  close() {
    this.pause();
    if (this.onTheme) this.dark.removeEventListener("change", this.onTheme);
    for (const curve of this.curves) curve.close();
    this.stage?.close();
    this.root.replaceChildren();
  }
}

/**
 * @param {number[]} vector
 * @param {number} factor
 */
function scaled(vector, factor) {
  return vector.map((value) => (Number.isFinite(value * factor) ? value * factor : 0));
}

/**
 * The greatest length of vectors; 0 where there are none.
 * @param {Float32Array[]} rows
 */
export function greatest(rows) {
  let most = 0;
  for (const row of rows) {
    for (let i = 0; i + 2 < row.length; i += 3) {
      const length = Math.hypot(row[i], row[i + 1], row[i + 2]);
      if (length > most) most = length;
    }
  }
  return most;
}

/**
 * Shows a mechanism in an element; what comes back takes it away again.
 * @param {HTMLElement} root
 * @param {Data} data
 * @returns {() => void}
 */
export function mount(root, data) {
  const view = new View(root, data);
  return () => view.close();
}
