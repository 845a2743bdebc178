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
  const reach = () => {
    // what scrolls can be reached and scrolled by keyboard
    for (const part of document.querySelectorAll("main pre, main .equation")) {
      if (part.scrollWidth > part.clientWidth) part.setAttribute("tabindex", "0");
      else part.removeAttribute("tabindex");
    }
  };
  reach();
  window.addEventListener("resize", reach);
  for (const part of document.querySelectorAll("details")) part.addEventListener("toggle", reach);
  /** @type {HTMLDetailsElement[]} */
  let opened = [];
  window.addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll(/** @type {"details"} */ ("details.printed"))].filter((part) => !part.open);
    for (const part of opened) part.open = true;
  });
  window.addEventListener("afterprint", () => {
    for (const part of opened) part.open = false;
  });
}

export { mount };
