import assert from "node:assert/strict";
import test from "node:test";
import { copied, numberOf, sorted } from "../src/tables.js";

test("the number that a cell begins with", () => {
  const cells = ["10.5", "-3e-4 N", "\u22122", "291 deg", "not unique", "", "6.4 (Fx Fy)", ".5"];
  assert.deepEqual(cells.map(numberOf), [10.5, -3e-4, -2, 291, null, null, 6.4, 0.5]);
});

test("numbers sort by value, before texts; equal rows keep their order both ways", () => {
  const rows = [["a", "10"], ["b", "9.5"], ["c", "not unique"], ["d", "-1"], ["e", "9.5"]];
  assert.deepEqual(sorted(rows, 1, false), [3, 1, 4, 0, 2]);
  assert.deepEqual(sorted(rows, 1, true), [0, 1, 4, 3, 2]);
  assert.deepEqual(sorted([["J10"], ["J9"], ["J1"]], 0, false), [2, 1, 0]);
});

test("what is copied is rows of a spreadsheet, and no formula", () => {
  assert.equal(copied([["pair", "force [N]"], ["=cmd", "-1.5e-3"], ["@a\nb", "+x"]]), "pair\tforce [N]\n'=cmd\t-1.5e-3\n'@a b\t'+x\n");
});
