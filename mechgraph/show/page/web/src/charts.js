/**
 * Curves over the positions, with one cursor for all of them.
 */
import { uPlot } from "./vendor.js";
import { shown, unpacked } from "./data.js";

/** @typedef {import("./data.js").Chart} Chart */
/** @typedef {import("./data.js").Cycle} Cycle */

const DASHES = [[], [7, 4], [2, 3], [10, 3, 2, 3], [1, 2], [12, 5]];

/** One chart with its values at the position shown below it, and what has none. */
export class Curves {
  /**
   * @param {HTMLElement} box
   * @param {Chart} chart
   * @param {Cycle} cycle
   * @param {{ ink: string, muted: string, grid: string, series: string[] }} colours
   * @param {(frame: number) => void} onFrame
   */
  constructor(box, chart, cycle, colours, onFrame) {
    this.x = unpacked(cycle.x);
    this.values = chart.series.map((series) => unpacked(series.values));
    this.chart = chart;
    this.frame = 0;
    this.root = document.createElement("figure");
    this.root.className = "chart";
    const unit = chart.unit ? ` [${chart.unit}]` : "";
    const caption = document.createElement("figcaption");
    caption.textContent = `${chart.title}${unit}`;
    this.area = document.createElement("div");
    this.area.className = "area";
    this.legend = document.createElement("ul");
    this.legend.className = "legend";
    this.root.append(caption, this.area, this.legend);
    box.append(this.root);
    this.outputs = chart.series.map((series, i) => this.entry(series, i, colours.series[i % colours.series.length]));
    for (const name of chart.open) this.legend.append(open(name));
    if (!this.values.length) {
      this.area.remove();
      return;
    }
    this.area.setAttribute("role", "img");
    this.area.setAttribute("aria-label", `${chart.title}${unit} over ${cycle.label}; its values at the position shown stand below`);
    this.plot = new uPlot(this.options(chart, cycle, colours, onFrame), [this.x, ...this.values], this.area);
    this.watch = new ResizeObserver(() => this.plot?.setSize({ width: Math.max(this.area.clientWidth, 120), height: 190 }));
    this.watch.observe(this.area);
  }

  /**
   * @param {import("./data.js").Series} series
   * @param {number} i
   * @param {string} colour
   */
  entry(series, i, colour) {
    const item = document.createElement("li");
    const line = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    line.setAttribute("width", "26");
    line.setAttribute("height", "8");
    line.setAttribute("aria-hidden", "true");
    const stroke = document.createElementNS("http://www.w3.org/2000/svg", "path");
    stroke.setAttribute("d", "M1 4H25");
    stroke.setAttribute("stroke", colour);
    stroke.setAttribute("stroke-width", "2");
    stroke.setAttribute("stroke-dasharray", dashes(series, i).join(" "));
    line.append(stroke);
    const value = document.createElement("output");
    item.append(line, ` ${series.name}${series.known === "unique" ? "" : " (least norm, one of many)"} `, value);
    this.legend.append(item);
    return value;
  }

  /**
   * @param {Chart} chart
   * @param {Cycle} cycle
   * @param {{ ink: string, muted: string, grid: string, series: string[] }} colours
   * @param {(frame: number) => void} onFrame
   * @returns {uPlot.Options}
   */
  options(chart, cycle, colours, onFrame) {
    const axis = { stroke: colours.ink, font: "12px system-ui, sans-serif", grid: { stroke: colours.grid, width: 1 }, ticks: { stroke: colours.grid, width: 1 } };
    return {
      width: Math.max(this.area.clientWidth, 120),
      height: 190,
      legend: { show: false },
      cursor: { drag: { x: false, y: false }, y: false },
      scales: { x: { time: false } },
      axes: [
        { ...axis, label: cycle.label, labelFont: "12px system-ui, sans-serif", labelSize: 20, size: 34 },
        { ...axis, size: 62, values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : shown(tick))) },
      ],
      series: [{}, ...chart.series.map((series, i) => ({ label: series.name, stroke: colours.series[i % colours.series.length], width: 2, dash: dashes(series, i), points: { show: this.x.length < 12 } }))],
      hooks: {
        ready: [
          (plot) => {
            const choose = (/** @type {PointerEvent} */ event) => {
              if (event.type === "pointermove" && !event.buttons) return;
              onFrame(plot.posToIdx(event.clientX - plot.over.getBoundingClientRect().left));
            };
            plot.over.addEventListener("pointerdown", choose);
            plot.over.addEventListener("pointermove", choose);
          },
        ],
        draw: [(plot) => this.drawCursor(plot, colours.ink)],
      },
    };
  }

  /**
   * A line at the position shown.
   * @param {uPlot} plot
   * @param {string} colour
   */
  drawCursor(plot, colour) {
    const x = plot.valToPos(this.x[this.frame], "x", true);
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.strokeStyle = colour;
    ctx.fillStyle = colour;
    ctx.lineWidth = devicePixelRatio;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    for (const values of this.values) {
      if (!Number.isFinite(values[this.frame])) continue;
      ctx.beginPath();
      ctx.arc(x, plot.valToPos(values[this.frame], "y", true), 3.5 * devicePixelRatio, 0, 2 * Math.PI);
      ctx.fill();
    }
    ctx.restore();
  }

  /** @param {number} frame */
  show(frame) {
    this.frame = frame;
    this.outputs.forEach((output, i) => (output.textContent = `${shown(this.values[i][frame])} ${this.chart.unit}`));
    this.plot?.redraw(false);
  }

  close() {
    this.watch?.disconnect();
    this.plot?.destroy();
    this.root.remove();
  }
}

/**
 * @param {import("./data.js").Series} series
 * @param {number} i
 */
function dashes(series, i) {
  return series.known === "unique" ? DASHES[i % DASHES.length] : [3, 3];
}

/** @param {string} name */
function open(name) {
  const item = document.createElement("li");
  item.className = "open";
  item.textContent = `${name}: not unique`;
  return item;
}
