// The types of the package of the same version; `check/package.json` pins it.
import uPlot from "uplot";
export default uPlot;
