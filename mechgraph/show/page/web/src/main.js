/**
 * The page comes to life; a notebook takes `mount` alone.
 */
import { enhance } from "./tables.js";
import { mount } from "./view.js";

/** Everything that waits in the page: the view, tables, and what is folded when it is printed. */
export function start() {
  const root = document.getElementById("view");
  const data = document.getElementById("data")?.textContent;
  if (root && data) mount(root, JSON.parse(data));
  for (const table of document.querySelectorAll("main table")) enhance(/** @type {HTMLTableElement} */ (table));
  /** @type {HTMLDetailsElement[]} */
  let opened = [];
  window.addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details")].filter((part) => !part.open);
    for (const part of opened) part.open = true;
  });
  window.addEventListener("afterprint", () => {
    for (const part of opened) part.open = false;
  });
}

export { mount };
