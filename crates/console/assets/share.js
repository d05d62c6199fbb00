// @ts-check
// Links to a run, a tick and a robot, in the fragment of the address, which never reaches a server; and pictures.

/** What a link leads to. @typedef {{run: string, tick: number | null, robot: string | null}} Target */

/** @param {string} fragment of an address, with or without # @returns {Target} */
export function readLink(fragment) {
  const parts = new URLSearchParams(fragment.replace(/^#/, ""));
  const tick = parts.get("tick") ?? "";

  return { run: parts.get("run") ?? "", tick: /^\d{1,9}$/.test(tick) ? Number(tick) : null, robot: parts.get("robot") };
}

/** @param {Target} target */
export function linkTo({ run, tick, robot }) {
  const parts = new URLSearchParams({ run });
  if (tick !== null) parts.set("tick", String(tick));
  if (robot !== null) parts.set("robot", robot);

  return `#${parts}`;
}

/**
 * Puts a link into the address bar, and into the clipboard if the browser allows it.
 * @param {Target} target
 * @returns {Promise<string>} what was done, for people
 */
export async function share(target) {
  history.replaceState(null, "", linkTo(target));
  try {
    await navigator.clipboard.writeText(location.href);
    return "The link is copied. It works in browsers that this console has admitted.";
  } catch {
    return "The link is in the address bar. It works in browsers that this console has admitted.";
  }
}

/**
 * @param {Blob} picture
 * @param {string} name of the file
 */
export function download(picture, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(picture);
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}
