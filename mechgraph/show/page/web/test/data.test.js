import assert from "node:assert/strict";
import test from "node:test";
import { advanced, between, shown, unpacked } from "../src/data.js";

test("numbers come as Python packed them, little-endian, NaN and all", () => {
  const bytes = Buffer.alloc(12);
  [1.5, -2, NaN].forEach((value, i) => bytes.writeFloatLE(value, 4 * i));
  assert.deepEqual([...unpacked({ shape: [3], f32: bytes.toString("base64") })], [1.5, -2, NaN]);
});

test("numbers for people", () => {
  const said = [0, -0, 1e-40, 0.327994, -123456.7, 1.23456e9, 0.000123456, 20, NaN, null, undefined].map((value) => shown(value));
  assert.deepEqual(said, ["0", "0", "0", "0.328", "-123500", "1.235e+9", "1.235e-4", "20", "not known", "not known", "not known"]);
});

test("maps between two steps lie on the way, and end at the ends", () => {
  const values = Float32Array.from({ length: 24 }, (_, i) => i);
  assert.deepEqual([...between(values, 1, 0)], [...values.slice(0, 12)]);
  assert.deepEqual([...between(values, 1, 0.25)], [...values.slice(0, 12)].map((v) => v + 3));
  assert.deepEqual([...between(values, 1, 7)], [...values.slice(12)]);
  assert.deepEqual([...between(values, 1, -1)], [...values.slice(0, 12)]);
});

test("a cycle begins anew, a swing turns round at its ends, what has one step rests", () => {
  assert.deepEqual(advanced(9, 1, 2, 10, "cycle"), [1, 1]);
  assert.deepEqual(advanced(8, 1, 3, 10, "swing"), [7, -1]);
  assert.deepEqual(advanced(1, -1, 3, 10, "swing"), [2, 1]);
  assert.deepEqual(advanced(5, -1, 3, 10, "swing"), [2, -1]);
  assert.deepEqual(advanced(0, 1, 3, 1, "swing"), [0, 1]);
  for (let frame = 0, way = 1, i = 0; i < 500; i++) {
    [frame, way] = advanced(frame, way, 0.7 + (i % 13), 10, "swing");
    assert.ok(frame >= 0 && frame <= 9 && Math.abs(way) === 1);
  }
});
