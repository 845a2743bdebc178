/**
 * Builds what the page is made of, from the packages of package-lock.json and our own modules:
 *
 *   vendor.js    the parts of three and uPlot that src/vendor.js names, with their licences
 *   vendor.css   the style sheet of uPlot
 *   view.js      our own modules, which find the above under the name mechgraphVendor
 *   built.json   versions and licences of the packages; SHA-256 of every file here and of what it was built from
 */
import { createHash } from "node:crypto";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const here = new URL("./", import.meta.url);
const read = (/** @type {string} */ name) => readFileSync(new URL(name, here), "utf8");
const hash = (/** @type {string} */ text) => createHash("sha256").update(text).digest("hex");

const packages = ["three", "uplot"].map((name) => {
  const { version, license } = JSON.parse(read(`node_modules/${name}/package.json`));
  return { name, version, license, text: read(`node_modules/${name}/LICENSE`).trim() };
});

/** @type {import("esbuild").BuildOptions} */
const common = {
  absWorkingDir: new URL(".", here).pathname,
  bundle: true,
  charset: "ascii",
  format: "iife",
  legalComments: "none",
  minify: true,
  target: "es2022",
  treeShaking: true,
  write: false,
};

/** What our modules import from vendor.js is already there, under one name. */
const vendorIsThere = {
  name: "vendor-is-there",
  setup(/** @type {import("esbuild").PluginBuild} */ of) {
    of.onResolve({ filter: /\/vendor\.js$/ }, () => ({ path: "vendor", namespace: "there" }));
    of.onLoad({ filter: /.*/, namespace: "there" }, () => ({ contents: "module.exports = mechgraphVendor" }));
  },
};

const banner = packages.map((p) => `/*! ${p.name} ${p.version} (${p.license})\n\n${p.text.replaceAll("*/", "* /")}\n*/`).join("\n");
const vendor = await build({ ...common, entryPoints: ["src/vendor.js"], globalName: "mechgraphVendor", banner: { js: banner } });
const view = await build({ ...common, entryPoints: ["src/main.js"], globalName: "mechgraphView", plugins: [vendorIsThere] });

const files = {
  "vendor.js": vendor.outputFiles?.[0]?.text ?? "",
  "vendor.css": read("node_modules/uplot/dist/uPlot.min.css"),
  "view.js": view.outputFiles?.[0]?.text ?? "",
};
for (const [name, text] of Object.entries(files)) {
  if (/<\/script/i.test(text)) throw new Error(`${name} would end the script that it stands in`);
  writeFileSync(new URL(name, here), text);
}
const sources = ["build.js", "package-lock.json", ...readdirSync(new URL("src/", here)).map((name) => `src/${name}`)].sort();
const built = {
  packages: packages.map(({ name, version, license }) => ({ name, version, license })),
  files: Object.fromEntries(Object.entries(files).map(([name, text]) => [name, hash(text)])),
  sources: Object.fromEntries(sources.map((name) => [name, hash(read(name))])),
};
writeFileSync(new URL("built.json", here), `${JSON.stringify(built, null, 2)}\n`);
