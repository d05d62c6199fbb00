// @ts-check
// Writes SVG in place of a canvas: what is drawn on it is the same.

const FULL_TURN = 2 * Math.PI;

/** As much of a canvas as the plan uses (`Paper` in `shapes.js`). */
export class Vector {
  constructor() {
    /** @type {string | CanvasGradient | CanvasPattern} */
    this.fillStyle = "#000000";
    /** @type {string | CanvasGradient | CanvasPattern} */
    this.strokeStyle = "#000000";
    this.lineWidth = 1;
    /** @type {CanvasLineCap} */
    this.lineCap = "butt";
    /** @type {CanvasLineJoin} */
    this.lineJoin = "miter";
    this.globalAlpha = 1;
    this.font = "12px sans-serif";
    /** @type {CanvasTextAlign} */
    this.textAlign = "start";
    /** @type {CanvasTextBaseline} */
    this.textBaseline = "alphabetic";
    /** @type {number[]} */
    this.dash = [];
    this.path = "";
    /** @type {string[]} */
    this.parts = [];
  }

  beginPath() {
    this.path = "";
  }

  /** @type {(x: number, y: number) => void} */
  moveTo(x, y) {
    this.path += `M${n(x)} ${n(y)}`;
  }

  /** @type {(x: number, y: number) => void} */
  lineTo(x, y) {
    this.path += `${this.path ? "L" : "M"}${n(x)} ${n(y)}`;
  }

  /** @type {(x: number, y: number, radius: number, from: number, to: number) => void} */
  arc(x, y, radius, from, to) {
    const at = (/** @type {number} */ angle) => /** @type {const} */ ([x + radius * Math.cos(angle), y + radius * Math.sin(angle)]);
    const isWhole = to - from >= FULL_TURN - 1e-9;
    this.lineTo(...at(from));
    // A whole circle is two arcs: one would end where it begins, and be none.
    for (const end of isWhole ? [from + Math.PI, from + FULL_TURN] : [to]) {
      const [right, down] = at(end);
      this.path += `A${n(radius)} ${n(radius)} 0 ${!isWhole && to - from > Math.PI ? 1 : 0} 1 ${n(right)} ${n(down)}`;
    }
  }

  /** @type {(x: number, y: number, width: number, height: number) => void} */
  rect(x, y, width, height) {
    this.path += `M${n(x)} ${n(y)}h${n(width)}v${n(height)}h${n(-width)}Z`;
  }

  fill() {
    this.put(`<path d="${this.path}" ${this.filled()}/>`);
  }

  stroke() {
    this.put(`<path d="${this.path}" fill="none" ${this.stroked()}/>`);
  }

  /** @type {(x: number, y: number, width: number, height: number) => void} */
  fillRect(x, y, width, height) {
    this.put(`<rect x="${n(x)}" y="${n(y)}" width="${n(width)}" height="${n(height)}" ${this.filled()}/>`);
  }

  /** @type {(x: number, y: number, width: number, height: number) => void} */
  strokeRect(x, y, width, height) {
    this.put(`<rect x="${n(x)}" y="${n(y)}" width="${n(width)}" height="${n(height)}" fill="none" ${this.stroked()}/>`);
  }

  /** @type {(words: string, x: number, y: number) => void} */
  fillText(words, x, y) {
    this.put(this.text(words, x, y, this.filled()));
  }

  /** @type {(words: string, x: number, y: number) => void} */
  strokeText(words, x, y) {
    this.put(this.text(words, x, y, `fill="none" ${this.stroked()}`));
  }

  /** @param {number[]} dash */
  setLineDash(dash) {
    this.dash = dash;
  }

  /**
   * An area or a line that is given as the path of an SVG.
   * @param {string} d
   * @param {string} attributes
   */
  shape(d, attributes) {
    this.put(`<path d="${d}" ${attributes}/>`);
  }

  /** @param {string} element */
  put(element) {
    this.parts.push(element);
  }

  /** @type {(words: string, x: number, y: number, paint: string) => string} */
  text(words, x, y, paint) {
    const anchor = { start: "start", left: "start", center: "middle", end: "end", right: "end" }[this.textAlign];
    // Not every program knows a baseline in the middle.
    const shift = this.textBaseline === "middle" ? ' dy="0.35em"' : "";
    return `<text x="${n(x)}" y="${n(y)}"${shift} text-anchor="${anchor}" style="font:${escape(this.font)}" ${paint}>${escape(words)}</text>`;
  }

  filled() {
    return `fill="${escape(String(this.fillStyle))}"${this.faint()}`;
  }

  stroked() {
    const dash = this.dash.length ? ` stroke-dasharray="${this.dash.map(n).join(" ")}"` : "";
    const ends = `${this.lineCap === "butt" ? "" : ` stroke-linecap="${this.lineCap}"`}${this.lineJoin === "miter" ? "" : ` stroke-linejoin="${this.lineJoin}"`}`;
    return `stroke="${escape(String(this.strokeStyle))}" stroke-width="${n(this.lineWidth)}"${dash}${ends}${this.faint()}`;
  }

  faint() {
    return this.globalAlpha < 1 ? ` opacity="${n(this.globalAlpha)}"` : "";
  }

  /**
   * What was drawn, as an element at a place of a picture; nothing is seen beyond its borders.
   * @type {(x: number, y: number, width: number, height: number) => string}
   */
  element(x, y, width, height) {
    return `<svg x="${n(x)}" y="${n(y)}" width="${n(width)}" height="${n(height)}" overflow="hidden">\n${this.parts.join("\n")}\n</svg>`;
  }

  /**
   * What was drawn, as a document that is so wide on paper.
   * @type {(width: number, height: number, title: string, width_mm: number) => string}
   */
  document(width, height, title, width_mm) {
    const size = `width="${n(width_mm)}mm" height="${n((width_mm * height) / width)}mm" viewBox="0 0 ${n(width)} ${n(height)}"`;
    return `<svg xmlns="http://www.w3.org/2000/svg" ${size} role="img">\n<title>${escape(title)}</title>\n${this.parts.join("\n")}\n</svg>\n`;
  }
}

/** A number with as many digits as are seen. @param {number} value */
function n(value) {
  return String(Number(value.toFixed(2)));
}

/** Names and commands are not ours: they are text, and never markup. @param {string} text */
function escape(text) {
  const names = { "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" };
  // XML has no word for other control characters, nor for halves of a character.
  return text
    .replace(/[^\t\n\r\x20-\uD7FF\uE000-\uFFFD\u{10000}-\u{10FFFF}]/gu, "\uFFFD")
    .replace(/[&<>"]/g, (sign) => names[/** @type {keyof typeof names} */ (sign)]);
}
