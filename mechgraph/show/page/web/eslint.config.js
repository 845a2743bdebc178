import js from "@eslint/js";

const browser = ["document", "window", "navigator", "getComputedStyle", "requestAnimationFrame", "cancelAnimationFrame", "matchMedia",
  "ResizeObserver", "atob", "performance", "HTMLElement", "devicePixelRatio"];
const node = ["URL", "Buffer"];

export default [
  { ignores: ["vendor.js", "view.js", "node_modules"] },
  js.configs.recommended,
  {
    languageOptions: { ecmaVersion: 2023, sourceType: "module", globals: Object.fromEntries([...browser, ...node].map((n) => [n, "readonly"])) },
    rules: {
      "no-console": "error",
      "no-var": "error",
      "prefer-const": "error",
      "no-eval": "error",
      "no-implied-eval": "error",
      "no-restricted-properties": ["error", ...["innerHTML", "outerHTML", "insertAdjacentHTML"].map((property) => ({ property, message: "text comes into the page as text" }))],
      eqeqeq: "error",
    },
  },
];
