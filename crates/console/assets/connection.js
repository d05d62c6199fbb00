// @ts-check
// The WebSocket to the console server: reconnects by itself and resolves every request with its answer.

/** @typedef {import("./types/messages.js").Control} Control */
/** @typedef {import("./types/messages.js").ControlAnswer} ControlAnswer */
/** @typedef {import("./types/messages.js").WorldFrame} WorldFrame */
/** @typedef {import("./types/messages.js").Panel} Panel */
/** @typedef {import("./types/messages.js").LogRecord} LogRecord */

/**
 * What the server sends.
 * @typedef {{type: "hello", mode: "live" | "recording", run: string, version: string}
 *   | {type: "simulator", present: boolean}
 *   | {type: "frame", frame: WorldFrame}
 *   | {type: "panel", robot: string, panel: Panel}
 *   | {type: "log", lines: LogRecord[], dropped: number}
 *   | {type: "answer", id: number, answer?: ControlAnswer, error?: string}} ServerMessage
 */

/** Messages that do not answer a request. @typedef {Exclude<ServerMessage, {type: "answer"}>} Broadcast */
/** @typedef {{resolve: (answer: ControlAnswer) => void, timer: number}} Pending */

const FIRST_PAUSE_MS = 500;
const LONGEST_PAUSE_MS = 8000;
const ANSWER_TIMEOUT_MS = 15000;

export class Connection {
  /**
   * @param {(message: Broadcast) => void} onMessage
   * @param {(isOpen: boolean) => void} onConnection
   */
  constructor(onMessage, onConnection) {
    this.onMessage = onMessage;
    this.onConnection = onConnection;
    /** @type {WebSocket | null} */
    this.socket = null;
    /** @type {Map<number, Pending>} */
    this.pending = new Map();
    this.lastId = 0;
    this.pause_ms = FIRST_PAUSE_MS;
  }

  /** Connects, and reconnects whenever the connection is lost. */
  open() {
    const url = new URL("ws", location.href);
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";

    const socket = new WebSocket(url);
    this.socket = socket;
    let wasOpen = false;

    socket.addEventListener("open", () => {
      wasOpen = true;
      this.pause_ms = FIRST_PAUSE_MS;
      this.onConnection(true);
    });

    socket.addEventListener("message", (event) => this.receive(String(event.data)));
    socket.addEventListener("close", () => {
      this.closed();
      if (!wasOpen) leaveIfRefused();
    });
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

  /**
   * Resolves with the answer. Failures of the connection look like refusals of the simulator, so that there is one way to
   * show both.
   * @param {{type: "control", control: Control} | {type: "command", to: string, command: string}} message
   * @returns {Promise<ControlAnswer>}
   */
  send(message) {
    const socket = this.socket;
    if (!socket || socket.readyState !== WebSocket.OPEN) {
      return Promise.resolve(refused("The console server is not reachable; the page reconnects by itself."));
    }

    const id = ++this.lastId;

    return new Promise((resolve) => {
      const timer = window.setTimeout(() => {
        this.settle(id, refused("No answer from the simulator in 15 seconds."));
      }, ANSWER_TIMEOUT_MS);
      this.pending.set(id, { resolve, timer });
      socket.send(JSON.stringify({ ...message, id }));
    });
  }

  /** @param {string} text */
  receive(text) {
    /** @type {ServerMessage} */
    const message = JSON.parse(text);
    if (message.type === "answer") {
      this.settle(message.id, message.answer ?? refused(message.error ?? "The server gave no reason."));
    } else {
      this.onMessage(message);
    }
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
    this.onConnection(false);

    for (const id of [...this.pending.keys()]) {
      this.settle(id, refused("The connection was lost before an answer arrived."));
    }

    window.setTimeout(() => this.open(), this.pause_ms);
    this.pause_ms = Math.min(this.pause_ms * 2, LONGEST_PAUSE_MS);
  }
}

/**
 * Leaves the page if the server refuses this browser: its cookie is lost, or another console has the address now. The
 * server's own page explains what to do. A script cannot see why a WebSocket was refused.
 */
async function leaveIfRefused() {
  try {
    const answer = await fetch("ws");
    if (answer.status === 403) location.replace("/");
  } catch {
    // The server is not reachable.
  }
}

/**
 * @param {string} explanation
 * @returns {ControlAnswer}
 */
function refused(explanation) {
  return { answer: "refused", explanation };
}
