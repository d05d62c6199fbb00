// The types of the package of the same version; `check/package.json` pins it.
export * from "lit-html";
