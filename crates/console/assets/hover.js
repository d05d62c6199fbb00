// @ts-check
// The full name and the states of the robot below the pointer, the site with its state, or the number of the layer that is shown.

import { layerWords, shownLayer } from "./layers.js";
import { siteAt, siteWords } from "./sites.js";

/** @typedef {import("./plan.js").Plan} Plan */

export class Hover {
  /**
   * @param {HTMLElement} label
   * @param {Plan} plan
   */
  constructor(label, plan) {
    this.label = label;
    this.plan = plan;
    /** Of the pointer, in the canvas. @type {{x: number, y: number} | null} */
    this.at = null;

    plan.canvas.addEventListener("pointermove", (event) => this.move(event));
    plan.canvas.addEventListener("pointerleave", () => this.leave());
    plan.store.on("frame", () => this.at && this.render());
  }

  /** @param {PointerEvent} event */
  move(event) {
    this.at = this.plan.gestures.at(event);
    this.render();
  }

  /** What is at a place, in words. @param {{x: number, y: number}} place */
  words(place) {
    const { plan } = this;
    const { frame } = plan.store;
    const name = plan.robotAt(place);
    const robot = frame?.robots.find((one) => one.name === name);
    if (robot) return [robot.name, robot.emotion_state, robot.behavior_state].filter(Boolean).join(" · ");

    const site = siteAt(frame?.sites ?? [], place, plan.camera.scale, frame?.body_m ?? 0);
    return site ? siteWords(site) : layerWords(shownLayer(frame?.layers, plan.chosenLayer), place);
  }

  leave() {
    this.at = null;
    this.label.hidden = true;
  }

  render() {
    const { at, plan } = this;
    if (!at) return;

    const words = plan.editor.draft ? "" : this.words(plan.camera.place(at.x, at.y));
    this.label.hidden = !words;
    if (!words) return;

    this.label.textContent = words;
    const isRight = at.x > plan.camera.width_px / 2;
    this.label.style.left = isRight ? "" : `${at.x + 14}px`;
    this.label.style.right = isRight ? `${plan.camera.width_px - at.x + 14}px` : "";
    this.label.style.top = `${Math.max(4, at.y - 34)}px`;
  }
}
