// @ts-check
// Renders the set-up form.

import { html, nothing } from "./vendor/lit-html.js";

/** How a number is typed: as it is, or in the chosen unit of length. @typedef {"plain" | "length"} Kind */

/**
 * What the form shows and calls.
 * @typedef {object} SetupView
 * @property {Setup | null} draft
 * @property {boolean} isChanged
 * @property {{isLive: boolean}} store
 * @property {{unit: string}} units
 * @property {(name: string, value: number, kind: Kind) => string} text
 * @property {(name: string, text: string, kind: Kind) => number} number
 * @property {(field: string, change: (draft: Setup) => void) => void} edit
 * @property {boolean} isOvertaken
 * @property {{past: unknown[], future: unknown[]}} undo
 * @property {() => void} begin
 * @property {() => void} refresh
 * @property {() => void} revert
 * @property {() => void} keepMine
 * @property {(isBack: boolean) => void} step
 * @property {() => void} drawSeed
 * @property {() => void} save
 * @property {(file: File) => void} load
 */

/** @typedef {import("./types/messages.js").Setup} Setup */
/** @typedef {import("./types/messages.js").Range} Range */
/** @typedef {Map<string, string>} Faults */

/**
 * @param {SetupView} view
 * @param {Faults} faults
 */
export function form(view, faults) {
  const { draft } = view;
  if (!draft) {
    const why = view.store.isLive ? "Loading the set-up …" : "The set-up appears here when a simulator is connected.";
    return html`<p class="muted">${why}</p>`;
  }

  const unit = view.units.unit;
  const submit = (/** @type {Event} */ event) => {
    event.preventDefault();
    view.begin();
  };

  return html`
    <form class="setup" novalidate autocomplete="off" @submit=${submit}>
      ${view.isOvertaken ? overtaken(view) : nothing}
      <div class="setup-fields">
        ${group(`Field, ${unit}`, "field_m", faults, [
          number(view, "field-width", "width", draft.field_m[0], "length", (d, v) => (d.field_m[0] = v), "field_m"),
          number(view, "field-height", "height", draft.field_m[1], "length", (d, v) => (d.field_m[1] = v), "field_m"),
        ])}
        ${group("Guests", "guests", faults, [
          number(view, "guests", "how many", draft.guests, "plain", (d, v) => (d.guests = v), "guests"),
        ])}
        ${group(`Guests' speed, ${unit}/s`, "guest_speed_mps", faults, range(view, "speed", "guest_speed_mps", "length"))}
        ${group("Guests change course after, s", "guest_duration_s", faults, range(view, "duration", "guest_duration_s", "plain"))}
        ${group("Run lasts, s", "duration_s", faults, [
          number(view, "run-duration", "simulated seconds", draft.duration_s, "plain", (d, v) => (d.duration_s = v), "duration_s"),
        ])}
        ${group("Seed", "seed", faults, [
          number(view, "seed", "of all random numbers", draft.seed, "plain", (d, v) => (d.seed = v), "seed"),
          html`<button type="button" data-testid="setup-seed-draw" @click=${() => view.drawSeed()}>Draw</button>`,
        ])}
        ${log(view, draft, faults)} ${obstacles(view, draft, faults)} ${robots(view, draft, faults, unit)}
        ${other(faults, draft)}
      </div>
      ${actions(view, faults)}
    </form>`;
}

/** Another set-up has been applied since this one was edited. @param {SetupView} view */
function overtaken(view) {
  return html`
    <div class="overtaken" role="alert" data-testid="setup-overtaken">
      <p>Another set-up has been applied meanwhile, by another browser or a command.</p>
      <div class="row">
        <button type="button" data-testid="setup-take-theirs" @click=${() => view.refresh()}>Take that one</button>
        <button type="button" data-testid="setup-keep-mine" @click=${() => view.keepMine()}>Keep my changes</button>
      </div>
    </div>`;
}

/**
 * @param {string} title
 * @param {string} field
 * @param {Faults} faults
 * @param {unknown} content
 */
function group(title, field, faults, content) {
  return html`
    <fieldset class=${faults.has(field) ? "faulty" : ""}>
      <legend>${title}</legend>
      <div class="row">${content}</div>
      <p class="fault" id="error-${field}" data-testid="error-${field}" role="alert">${faults.get(field) ?? ""}</p>
    </fieldset>`;
}

/**
 * @param {SetupView} view
 * @param {string} name
 * @param {string} label
 * @param {number} value
 * @param {Kind} kind
 * @param {(draft: Setup, value: number) => void} set
 * @param {string} field
 */
function number(view, name, label, value, kind, set, field) {
  const input = (/** @type {Event} */ event) => {
    const typed = view.number(name, /** @type {HTMLInputElement} */ (event.target).value, kind);
    view.edit(field, (draft) => set(draft, typed));
  };

  return html`
    <label class="field"><span>${label}</span>
      <input type="text" inputmode="decimal" data-testid="setup-${name}" aria-describedby="error-${field}"
        .value=${view.text(name, value, kind)} @input=${input} /></label>`;
}

/**
 * @param {SetupView} view
 * @param {string} name
 * @param {"guest_speed_mps" | "guest_duration_s"} field
 * @param {Kind} kind
 */
function range(view, name, field, kind) {
  const labels = /** @type {const} */ ({ min: "least", mode: "most likely", max: "largest" });
  return /** @type {const} */ (["min", "mode", "max"]).map((key) =>
    number(view, `${name}-${key}`, labels[key], view.draft?.[field][key] ?? NaN, kind, (d, v) => (d[field][key] = v), field),
  );
}

/**
 * @param {SetupView} view
 * @param {Setup} draft
 * @param {Faults} faults
 */
function log(view, draft, faults) {
  const toggle = (/** @type {Event} */ event) =>
    view.edit("log_file.name", (d) => (d.log_file.enabled = /** @type {HTMLInputElement} */ (event.target).checked));
  const rename = (/** @type {Event} */ event) =>
    view.edit("log_file.name", (d) => (d.log_file.name = /** @type {HTMLInputElement} */ (event.target).value));

  return group("Log file", "log_file.name", faults, [
    html`<label class="check"><input type="checkbox" data-testid="setup-log" .checked=${draft.log_file.enabled} @change=${toggle} />
      <span>write it</span></label>`,
    html`<label class="field"><span>name, in the run's folder</span>
      <input type="text" data-testid="setup-log-name" aria-describedby="error-log_file.name" .value=${draft.log_file.name}
        ?disabled=${!draft.log_file.enabled} @input=${rename} /></label>`,
  ]);
}

/**
 * @param {SetupView} view
 * @param {Setup} draft
 * @param {Faults} faults
 */
function obstacles(view, draft, faults) {
  const count = draft.obstacles.length;
  return group("Fixed obstacles", "obstacles", faults, [
    html`<span data-testid="setup-obstacles">${count === 1 ? "1 obstacle" : `${count} obstacles`}</span>`,
    html`<button type="button" data-testid="setup-obstacles-clear" ?disabled=${count === 0}
      @click=${() => view.edit("obstacles", (d) => (d.obstacles = []))}>Remove all</button>`,
    html`<span class="hint">on the plan: a click places or removes one, a drag builds a wall; or with the keys: arrows, Enter, M</span>`,
  ]);
}

/**
 * @param {SetupView} view
 * @param {Setup} draft
 * @param {Faults} faults
 * @param {string} unit
 */
function robots(view, draft, faults, unit) {
  return Object.entries(draft.robots).map(([name, at]) =>
    group(`${name} starts at, ${unit}`, `robots.${name}`, faults, [
      number(view, `robot-${name}-x`, "x", at.x, "length", (d, v) => (d.robots[name].x = v), `robots.${name}`),
      number(view, `robot-${name}-y`, "y", at.y, "length", (d, v) => (d.robots[name].y = v), `robots.${name}`),
      html`<span class="hint">or drag it on the plan</span>`,
    ]),
  );
}

/**
 * Reasons of fields that the form does not have.
 * @param {Faults} faults
 * @param {Setup} draft
 */
function other(faults, draft) {
  const own = ["field_m", "guests", "guest_speed_mps", "guest_duration_s", "duration_s", "seed", "log_file.name", "obstacles"];
  const robots = Object.keys(draft.robots).map((name) => `robots.${name}`);
  const rest = [...faults].filter(([field]) => !own.includes(field) && !robots.includes(field));
  return rest.map(([field, reason]) => html`<p class="fault" data-testid="error-${field}" role="alert">${field}: ${reason}</p>`);
}

/**
 * @param {SetupView} view
 * @param {Faults} faults
 */
function actions(view, faults) {
  const load = (/** @type {Event} */ event) => {
    const input = /** @type {HTMLInputElement} */ (event.target);
    const file = input.files?.[0];
    // At once: while the file is loaded the user may have chosen the next one.
    input.value = "";
    if (file) view.load(file);
  };

  return html`
    <div class="setup-actions">
      <button type="submit" class="primary" data-testid="setup-apply">Apply and init</button>
      <button type="button" data-testid="setup-undo" title="Ctrl+Z" ?disabled=${view.undo.past.length === 0} @click=${() => view.step(true)}>Undo</button>
      <button type="button" data-testid="setup-redo" title="Ctrl+Shift+Z" ?disabled=${view.undo.future.length === 0} @click=${() => view.step(false)}>Redo</button>
      <button type="button" data-testid="setup-revert" title="back to the set-up of the run" ?disabled=${!view.isChanged} @click=${() => view.revert()}>Revert</button>
      <span class="form-state">${faults.size > 0 ? html`<span class="fault">${faults.size === 1 ? "1 thing" : `${faults.size} things`} to correct</span>`
        : view.isChanged ? html`<span class="muted">changed, not applied</span>` : nothing}</span>
      <label class="button">Load …<input type="file" accept=".toml,text/plain" class="hidden-file" data-testid="setup-load" @change=${load} /></label>
      <button type="button" data-testid="setup-save" @click=${() => view.save()}>Save</button>
    </div>`;
}
