/**
 * Tables that sort and copy.
 */

const NUMBER = /^[-+\u2212]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?/i;

/**
 * The number with which a cell begins, or nothing.
 * @param {string} text
 */
export function numberOf(text) {
  const found = NUMBER.exec(text.trim());
  return found ? Number(found[0].replace("\u2212", "-")) : null;
}

/**
 * Rows in the order of one column: numbers by their value, before texts; equal ones stay as they were.
 * @param {string[][]} rows
 * @param {number} column
 * @param {boolean} down
 * @returns {number[]} numbers of rows
 */
export function sorted(rows, column, down) {
  const sign = down ? -1 : 1;
  const keys = rows.map((row) => numberOf(row[column] ?? ""));
  return rows
    .map((_, i) => i)
    .sort((i, j) => {
      const [a, b] = [keys[i], keys[j]];
      if (a !== null && b !== null) return sign * (a - b) || i - j;
      if ((a === null) !== (b === null)) return a === null ? 1 : -1;
      return sign * (rows[i][column] ?? "").localeCompare(rows[j][column] ?? "", undefined, { numeric: true }) || i - j;
    });
}

/**
 * Cells as a spreadsheet takes them; what it would take for a formula begins with an apostrophe.
 * @param {string[][]} rows
 */
export function copied(rows) {
  const cell = (/** @type {string} */ text) => {
    const one = text.replace(/\s+/g, " ").trim();
    return /^[=+@-]/.test(one) && !/^[-+][\d.][\d.e+-]*$/i.test(one) ? `'${one}` : one;
  };
  return `${rows.map((row) => row.map(cell).join("\t")).join("\n")}\n`;
}

/** @param {Iterable<Element>} cells */
const texts = (cells) => [...cells].map((cell) => cell.textContent ?? "");

/**
 * A text into the clipboard; a page that is opened from a file may have none.
 * @param {string} text
 */
async function intoClipboard(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
}

/**
 * Makes a table sort by its heads and copy itself.
 * @param {HTMLTableElement} table
 */
export function enhance(table) {
  const body = table.tBodies[0];
  const heads = [...(table.tHead?.rows[0]?.cells ?? [])];
  if (!body || table.dataset["ready"]) return;
  table.dataset["ready"] = "yes";
  const frame = document.createElement("div");
  frame.className = "table";
  const scroll = document.createElement("div");
  scroll.className = "scroll";
  scroll.tabIndex = 0;
  scroll.setAttribute("role", "group");
  scroll.setAttribute("aria-label", table.caption?.textContent || `table: ${texts(heads).filter(Boolean).join(", ") || "values"}`);
  const copy = document.createElement("button");
  copy.type = "button";
  copy.className = "copy";
  copy.textContent = "Copy";
  copy.setAttribute("aria-label", "Copy this table");
  copy.addEventListener("click", async () => {
    await intoClipboard(copied([...table.rows].map((row) => texts(row.cells))));
    copy.textContent = "Copied";
    window.setTimeout(() => (copy.textContent = "Copy"), 1500);
  });
  table.replaceWith(frame);
  scroll.append(table);
  frame.append(copy, scroll);
  if (body.rows.length < 2) return;
  heads.forEach((head, column) => {
    if (!head.textContent) return;
    const button = document.createElement("button");
    button.type = "button";
    button.className = "sort";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const rows = [...body.rows];
      body.append(...sorted(rows.map((row) => texts(row.cells)), column, down).map((i) => rows[i]));
    });
  });
}
