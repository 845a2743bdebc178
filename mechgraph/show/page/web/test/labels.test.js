import assert from "node:assert/strict";
import test from "node:test";
import { placed } from "../src/labels.js";

/** @param {number} seed */
function random(seed) {
  let state = seed;
  return () => (state = (state * 16807) % 2147483647) / 2147483647;
}

test("no label covers another, covers a point of another, or is cut", () => {
  for (let seed = 1; seed < 40; seed++) {
    const next = random(seed);
    const wishes = Array.from({ length: 30 }, () => ({ x: 400 * next(), y: 300 * next(), width: 20 + 60 * next(), height: 15, weight: Math.floor(3 * next()) }));
    const places = placed(wishes, 400, 300);
    const boxes = places.flatMap((place, i) => (place ? [{ i, ...place, right: place.left + wishes[i].width, bottom: place.top + 15 }] : []));
    assert.ok(boxes.length >= 10);
    for (const a of boxes) {
      assert.ok(a.left >= 0 && a.top >= 0 && a.right <= 400 && a.bottom <= 300);
      for (const b of boxes) assert.ok(a.i === b.i || a.left >= b.right || b.left >= a.right || a.top >= b.bottom || b.top >= a.bottom);
      for (const [j, { x, y }] of wishes.entries()) assert.ok(j === a.i || x < a.left || x > a.right || y < a.top || y > a.bottom);
    }
  }
});

test("where there is room for one only, the weightier one has it", () => {
  const wish = { x: 10, y: 20, width: 36, height: 15 };
  const places = placed([{ ...wish, weight: 1 }, { ...wish, weight: 2 }], 64, 40);
  assert.equal(places[0], null);
  assert.ok(places[1]);
});

test("what is off the screen has no label", () => {
  assert.deepEqual(placed([{ x: -500, y: 10, width: 30, height: 15, weight: 1 }], 100, 100), [null]);
});
