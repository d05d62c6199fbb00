// @ts-check
// The WebSocket to the console server: reconnects by itself and resolves every request with its answer.

/** @typedef {import("./types/messages.js").Control} Control */
/** @typedef {import("./types/messages.js").ControlAnswer} ControlAnswer */
/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {import("./types/messages.js").TickPanel} TickPanel */
/** @typedef {import("./types/messages.js").LogRecord} LogRecord */

/**
 * What the server sends.
 * @typedef {{type: "hello", mode: "live" | "recording", run: string, endpoint?: string, version: string, has_guide: boolean}
 *   | {type: "beat", at_ms: number}
 *   | {type: "simulator", present: boolean}
 *   | {type: "frame", frame: WorldFrame}
 *   | {type: "panel", robot: string, panel: TickPanel}
 *   | {type: "log", lines: LogRecord[], dropped: number}
 *   | {type: "failed", failed: Failed}
 *   | {type: "answer", id: number, answer?: ControlAnswer, error?: string}} ServerMessage
 */

/** Why a run has failed, and the command by which it goes on. @typedef {{text: string, lines: string[], log: string, command: string}} Failed */
/** Messages for the store. @typedef {Exclude<ServerMessage, {type: "answer" | "beat"}>} Broadcast */
/** The first message of a server. @typedef {Extract<ServerMessage, {type: "hello"}>} Hello */
/** @typedef {{resolve: (answer: ControlAnswer) => void, timer: number}} Pending */

const FIRST_PAUSE_MS = 500;
const LONGEST_PAUSE_MS = 8000;
const ANSWER_TIMEOUT_MS = 15000;
/** The server sends a beat every half second. Without a message for this long the connection is lost; `browser.rs` carries out no
 * request that may be older. */
const SILENCE_MS = 2500;
/** Over a slow link one message may take longer: after each loss by silence twice as long is waited, up to this. */
const LONGEST_SILENCE_MS = 20000;
const LOOK_EVERY_MS = 100;
/** This page did not run for a while: what has arrived meanwhile is yet to be read. */
const OVERSLEPT_MS = 1000;

/** Another run at the address of this page; without a name if the server there refuses this browser. @typedef {{run: string | null}} Stranger */

export class Connection {
  /**
   * @param {(message: Broadcast) => void} onMessage
   * @param {(isOpen: boolean) => void} onConnection
   * @param {(stranger: Stranger | null) => void} onStranger
   */
  constructor(onMessage, onConnection, onStranger) {
    this.onMessage = onMessage;
    this.onConnection = onConnection;
    this.onStranger = onStranger;
    /** What the first server showed. The page stays with it. @type {Hello | null} */
    this.shown = null;
    /** Whether the page shows anything that would be lost. */
    this.hasContent = false;
    /** What is at the address now, if that is something else. @type {Stranger | null} */
    this.stranger = null;
    /** @type {WebSocket | null} */
    this.socket = null;
    /** @type {Map<number, Pending>} */
    this.pending = new Map();
    this.lastId = 0;
    this.pause_ms = FIRST_PAUSE_MS;
    this.silence_ms = SILENCE_MS;
    /** When something was heard last, or the attempt to connect began, in the time of `performance.now()`. */
    this.heardAt_ms = 0;
    this.lookedAt_ms = 0;
    /** The server's time in its newest beat. @type {number | undefined} */
    this.beat_ms = undefined;
    window.setInterval(() => this.look(), LOOK_EVERY_MS);
  }

  /** Connects, and reconnects whenever the connection is lost. */
  open() {
    const url = new URL("ws", location.href);
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";

    const socket = new WebSocket(url);
    this.socket = socket;
    this.heardAt_ms = performance.now();
    this.beat_ms = undefined;
    let wasOpen = false;

    // A connection that was given up has no say any more.
    const isCurrent = () => this.socket === socket;
    socket.addEventListener("open", () => {
      wasOpen = true;
      if (isCurrent()) this.pause_ms = FIRST_PAUSE_MS;
    });

    socket.addEventListener("message", (event) => {
      if (isCurrent()) this.receive(String(event.data));
    });
    socket.addEventListener("close", () => {
      if (!isCurrent()) return;
      this.closed();
      if (!wasOpen) this.explainIfRefused();
    });
  }

  /** Gives up a connection that is silent: it would be closed after minutes only. */
  look() {
    const now_ms = performance.now();
    const hasSlept = now_ms - this.lookedAt_ms > OVERSLEPT_MS;
    this.lookedAt_ms = now_ms;
    if (hasSlept) this.heardAt_ms = now_ms;
    const socket = this.socket;
    if (!socket || now_ms - this.heardAt_ms < this.silence_ms) return;

    this.silence_ms = Math.min(this.silence_ms * 2, LONGEST_SILENCE_MS);
    this.closed();
    socket.close();
  }

  /**
   * Sends a request to the simulator.
   * @param {Control} control
   */
  control(control) {
    return this.send({ type: "control", control });
  }

  /**
   * Sends a command to a robot.
   * @param {string} to
   * @param {string} command
   */
  command(to, command) {
    return this.send({ type: "command", to, command });
  }

  /** Has a run that has failed go on: its launcher starts the processes again, this console included. */
  resume() {
    return this.send({ type: "resume" });
  }

  /**
   * Resolves with the answer. Failures of the connection look like refusals of the simulator, so that there is one way to
   * show both.
   * @param {{type: "control", control: Control} | {type: "command", to: string, command: string} | {type: "resume"}} message
   * @returns {Promise<ControlAnswer>}
   */
  send(message) {
    if (this.stranger) return Promise.resolve(refused("This address shows another run now; nothing was sent."));

    const socket = this.socket;
    if (!socket || socket.readyState !== WebSocket.OPEN) {
      return Promise.resolve(refused("The console server is not reachable, and nothing was sent; the page reconnects by itself."));
    }

    const id = ++this.lastId;

    return new Promise((resolve) => {
      const timer = window.setTimeout(() => {
        this.settle(id, refused("No answer from the simulator in 15 seconds."));
      }, ANSWER_TIMEOUT_MS);
      this.pending.set(id, { resolve, timer });
      socket.send(JSON.stringify({ ...message, id, heard_ms: this.beat_ms }));
    });
  }

  /** @param {string} text */
  receive(text) {
    /** @type {ServerMessage} */
    const message = JSON.parse(text);
    this.heardAt_ms = performance.now();
    if (message.type === "beat") {
      // A second beat in time: the link is fast enough again.
      if (this.beat_ms !== undefined) this.silence_ms = SILENCE_MS;
      this.beat_ms = message.at_ms;
      return;
    }
    if (message.type === "hello") this.greet(message);
    if (this.stranger) return;
    if (message.type === "frame" || this.shown?.mode === "recording") this.hasContent = true;

    if (message.type === "answer") {
      this.settle(message.id, message.answer ?? refused(message.error ?? "The server gave no reason."));
    } else {
      this.onMessage(message);
    }
  }

  /**
   * A server may show another run than the one that had the address before. What it sends is ignored then.
   * @param {Hello} hello
   */
  greet(hello) {
    this.shown ??= hello;
    const isSame = hello.run === this.shown.run && hello.mode === this.shown.mode;
    this.meet(isSame ? null : { run: hello.mode === "live" ? hello.run : `the recording of ${hello.run}` });
    if (isSame) this.onConnection(true);
  }

  /** @param {Stranger | null} stranger */
  meet(stranger) {
    this.stranger = stranger;
    this.onStranger(stranger);
  }

  /**
   * Where the server refuses this browser, its cookie is lost, or another console has the address now. The server's own page
   * explains what to do: a page without content leaves for it. A script cannot see why a WebSocket was refused.
   */
  async explainIfRefused() {
    try {
      const answer = await fetch("ws");
      if (answer.status !== 403) return;
    } catch {
      // The server is not reachable.
      return;
    }

    if (this.hasContent) this.meet({ run: null });
    else location.replace("/");
  }

  /**
   * @param {number} id
   * @param {ControlAnswer} answer
   */
  settle(id, answer) {
    const pending = this.pending.get(id);
    if (!pending) return;
    this.pending.delete(id);
    clearTimeout(pending.timer);
    pending.resolve(answer);
  }

  closed() {
    this.socket = null;
    this.onConnection(false);

    for (const id of [...this.pending.keys()]) {
      this.settle(id, refused("The connection was lost before an answer arrived. What was not done by then is not done later."));
    }

    window.setTimeout(() => this.open(), this.pause_ms);
    this.pause_ms = Math.min(this.pause_ms * 2, LONGEST_PAUSE_MS);
  }
}

/**
 * @param {string} explanation
 * @returns {ControlAnswer}
 */
function refused(explanation) {
  return { answer: "refused", explanation };
}
