/**
 * What Python hands over, and how its numbers are read. Text stays text: nothing here is ever parsed as HTML.
 *
 * @typedef {{ shape: number[], f32: string }} Packed numbers, little-endian, in base64
 * @typedef {Float32Array} Numbers
 *
 * @typedef {object} Piece a solid or lines in a frame; `role` says how it is painted
 * @property {number} frame
 * @property {number} pair -1 for what is no part of a pair
 * @property {string} role
 * @property {string} colour of its link, empty for what is of none
 * @property {boolean} dashed what touches nothing
 * @property {Packed} vertices
 * @property {number[]} triangles
 * @property {number[]} lines ends of segments
 * @property {number[]} scales pixels of a unit of length from which on it is seen, and up to which, 0 for ever
 *
 * @typedef {{ text: string, kind: string, frame: number, pair: number, at: number[] }} Label
 * @typedef {{ name: string, type: string, title: string, a: string, b: string, frame: number, at: number[], rows: string[][] }} Pair
 * @typedef {{ name: string, colour: string }} Link
 *
 * @typedef {object} Figure a mechanism where it stands
 * @property {string} name
 * @property {number} size
 * @property {number} symbol half width of a symbol
 * @property {number[]} span width and height of all of it, seen as it is meant
 * @property {number[]} center
 * @property {number[]} up
 * @property {number[]} look from where it is seen
 * @property {Link[]} links
 * @property {Pair[]} pairs
 * @property {Piece[]} pieces
 * @property {Label[]} labels
 * @property {Packed} frames affine maps (frames, 12), row by row
 *
 * @typedef {object} Motion what frames do over a number of steps
 * @property {number[]} frames those that move
 * @property {Packed} values (steps, frames, 12)
 * @property {"cycle" | "swing" | "spin"} kind
 * @property {string[]} [places] every step in words
 *
 * @typedef {{ at: number[], force: number[], moment: number[], open: boolean }} Arrow
 *
 * @typedef {object} Item something to show
 * @property {string} group
 * @property {string} title
 * @property {string} text
 * @property {number} figure
 * @property {Motion | null} motion
 * @property {Arrow[]} arrows
 * @property {number[]} marked numbers of pairs
 * @property {number[][]} axes each a point and a direction
 * @property {Piece[]} pieces shown with it alone
 * @property {{ figure: number, rows: string[][], verdict: string } | null} after
 *
 * @typedef {{ name: string, values: Packed, known: "unique" | "least norm" }} Series
 * @typedef {{ title: string, unit: string, series: Series[], open: string[] }} Chart
 * @typedef {{ pair: number, at: Packed, force: Packed, moment: Packed, open: string[] }} Forces
 *
 * @typedef {object} Cycle values over the positions of a solution
 * @property {string} label of the abscissa, with its unit
 * @property {Packed} x
 * @property {string[]} places in words, one a position
 * @property {Forces[]} forces
 * @property {Chart[]} efforts
 * @property {Chart[][]} pairs charts of every pair
 *
 * @typedef {{ figures: Figure[], items: Item[], cycle: Cycle | null, note: string }} Data
 */

/**
 * Numbers as Python packed them.
 * @param {Packed} packed
 * @returns {Numbers}
 */
export function unpacked(packed) {
  const bytes = Uint8Array.from(atob(packed.f32), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return Float32Array.from({ length: bytes.length / 4 }, (_, i) => view.getFloat32(4 * i, true));
}

/**
 * A number for people: four digits, no negative zero; nothing known is said so.
 * @param {number | null | undefined} value
 */
export function shown(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "not known";
  if (Math.abs(value) < 1e-30) return "0";
  const text = Number(value.toPrecision(4));
  return Math.abs(text) >= 1e6 || Math.abs(text) < 1e-3 ? text.toExponential() : String(text);
}

/**
 * Maps between two steps of a motion.
 * @param {Numbers} values (steps, frames, 12)
 * @param {number} frames
 * @param {number} at step, a fraction too
 * @returns {Float64Array} (frames, 12)
 */
export function between(values, frames, at) {
  const width = 12 * frames;
  const last = values.length / width - 1;
  const first = Math.min(Math.max(Math.floor(at), 0), last);
  const next = Math.min(first + 1, last);
  const share = Math.min(Math.max(at - first, 0), 1);
  return Float64Array.from({ length: width }, (_, i) => (1 - share) * values[first * width + i] + share * values[next * width + i]);
}

/**
 * The frame after some seconds of play: a cycle and a spin begin anew, a swing goes to and fro.
 * @param {number} frame
 * @param {number} direction 1 or -1
 * @param {number} step
 * @param {number} count of frames
 * @param {string} kind of motion
 * @returns {[number, number]} frame and direction
 */
export function advanced(frame, direction, step, count, kind) {
  const last = count - 1;
  if (last <= 0) return [0, 1];
  if (kind !== "swing") return [(frame + step) % count, 1];
  let next = frame + direction * step;
  let way = direction;
  if (next > last) [next, way] = [2 * last - next, -1];
  if (next < 0) [next, way] = [-next, 1];
  return [Math.min(Math.max(next, 0), last), way];
}
