// Checks that the vendored files are those of the packages that `package.json` pins, except for the source map comment.

import { readFileSync } from "node:fs";

const FILES = {
  "lit-html.js": "lit-html/lit-html.js",
  "uPlot.esm.js": "uplot/dist/uPlot.esm.js",
  "uPlot.min.css": "uplot/dist/uPlot.min.css",
};
const read = (path) => readFileSync(new URL(path, import.meta.url), "utf8");
const plain = (text) => text.replace(/^\/\/# sourceMappingURL.*\n?/gm, "").trimEnd();

const different = Object.entries(FILES).filter(
  ([vendored, original]) => plain(read(`../assets/vendor/${vendored}`)) !== plain(read(`node_modules/${original}`)),
);
for (const [vendored, original] of different) console.error(`assets/vendor/${vendored} is not the pinned ${original}`);
process.exit(different.length === 0 ? 0 : 1);
