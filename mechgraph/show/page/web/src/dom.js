/**
 * The elements of the view. Text is set as text, never parsed.
 */

/**
 * An element with properties and children.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Partial<HTMLElementTagNameMap[K]>} [properties]
 * @param {(Node | string)[]} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function made(tag, properties = {}, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

/**
 * @param {string} text
 * @param {string} said
 */
function button(text, said) {
  const node = made("button", { type: "button", textContent: text, title: said });
  if (text.length === 1) node.setAttribute("aria-label", said);
  return node;
}

/** @param {string} name */
function box(name) {
  const input = made("input", { type: "checkbox", checked: true });
  return { input, label: made("label", { className: "toggle" }, input, ` ${name}`) };
}

/**
 * All elements of the view, in their places.
 * @param {HTMLElement} root
 */
export function elements(root) {
  root.classList.add("mg-view");
  const ui = {
    stage: made("div", { className: "stage" }),
    caption: made("p", { className: "caption" }),
    play: made("button", { type: "button", className: "play", textContent: "Play" }),
    slider: made("input", { type: "range", min: "0", step: "1", value: "0" }),
    place: made("output", { className: "place" }),
    fit: button("Fit", "show all of it, seen as at first"),
    larger: button("+", "zoom in"),
    smaller: button("\u2212", "zoom out"),
    names: box("names"),
    forces: box("forces"),
    bar: made("div", { className: "bar" }),
    sides: made("div", { className: "sides" }),
    choices: made("div", { className: "choices" }),
    efforts: made("div", { className: "charts" }),
    select: made("select"),
    facts: made("dl", { className: "facts" }),
    charts: made("div", { className: "charts" }),
  };
  ui.caption.setAttribute("aria-live", "polite");
  ui.choices.setAttribute("role", "group");
  ui.choices.setAttribute("aria-label", "what is shown");
  ui.bar.append(ui.play, ui.slider, ui.place);
  const tools = made("div", { className: "tools" }, ui.fit, ui.larger, ui.smaller, ui.names.label, ui.forces.label);
  const screen = made("div", { className: "screen" }, tools, ui.stage, ui.bar, ui.caption, ui.sides);
  const panel = made("div", { className: "panel" }, made("label", { className: "which" }, "Numbers of the pair ", ui.select), ui.facts, ui.charts);
  root.append(made("div", { className: "both" }, screen, ui.choices), ui.efforts, panel);
  return ui;
}

/**
 * Rows of a small table with heads.
 * @param {string[]} heads
 * @param {string[][]} rows
 */
export function table(heads, rows) {
  const line = (/** @type {string[]} */ row) =>
    made("tr", {}, ...row.map((textContent, i) => (i ? made("td", { textContent }) : made("th", { textContent, scope: "row" }))));
  const head = made("tr", {}, ...heads.map((textContent) => (textContent ? made("th", { textContent, scope: "col" }) : made("td"))));
  return made("table", {}, made("thead", {}, head), made("tbody", {}, ...rows.map(line)));
}

/**
 * Colours as the style sheet has them at an element.
 * @param {HTMLElement} root
 */
export function coloursOf(root) {
  const style = getComputedStyle(root);
  const of = (/** @type {string} */ name) => style.getPropertyValue(`--${name}`).trim();
  return {
    ink: of("ink"), muted: of("muted"), grid: of("grid"), ground: of("ground"), body: of("body"), load: of("load"),
    force: of("force"), moment: of("moment"), mark: of("mark"), series: of("series").split(/\s*,\s*/),
  };
}
