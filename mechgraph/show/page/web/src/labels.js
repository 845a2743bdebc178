/**
 * Where labels stand: beside their points, none on another, none cut; what finds no place is left out.
 *
 * @typedef {{ x: number, y: number, width: number, height: number, weight: number }} Wish a point of the screen and the size of its text
 * @typedef {{ left: number, top: number } | null} Place
 */

const SIDES = [[1, -1], [1, 1], [-1, -1], [-1, 1], [0, -1], [0, 1], [1, 0], [-1, 0]];
const REACHES = [9, 20, 34];

/**
 * Places for all, the weightiest first.
 * @param {Wish[]} wishes
 * @param {number} width of the screen
 * @param {number} height
 * @returns {Place[]}
 */
export function placed(wishes, width, height) {
  /** @type {{ left: number, top: number, right: number, bottom: number }[]} */
  const taken = wishes.map(({ x, y }) => ({ left: x - 5, top: y - 5, right: x + 5, bottom: y + 5 }));
  /** @type {Place[]} */
  const out = wishes.map(() => null);
  const order = wishes.map((_, i) => i).sort((i, j) => wishes[j].weight - wishes[i].weight || i - j);
  for (const i of order) {
    const { x, y, width: w, height: h } = wishes[i];
    for (const reach of REACHES) {
      const found = SIDES.map(([sx, sy]) => ({
        left: sx > 0 ? x + reach : sx < 0 ? x - reach - w : x - w / 2,
        top: sy > 0 ? y + reach * 0.6 : sy < 0 ? y - reach * 0.6 - h : y - h / 2,
      })).find(({ left, top }) => {
        if (left < 2 || top < 2 || left + w > width - 2 || top + h > height - 2) return false;
        return !taken.some((t, j) => j !== i && left < t.right && left + w > t.left && top < t.bottom && top + h > t.top);
      });
      if (found) {
        out[i] = found;
        taken.push({ left: found.left, top: found.top, right: found.left + w, bottom: found.top + h });
        break;
      }
    }
  }
  return out;
}
