// Types of the messages that the page handles, from the JSON Schemas of the protocol.
//
//     node types.mjs            writes assets/types/messages.d.ts
//     node types.mjs --check    fails if that file is not what would be written

import { readFileSync, writeFileSync } from "node:fs";
import { compile } from "json-schema-to-typescript";

const MESSAGES = [
  "control",
  "control_answer",
  "log_record",
  "panel",
  "world_frame",
];
const OUTPUT = new URL("../assets/types/messages.d.ts", import.meta.url);
const BANNER = "// Generated from docs/schemas by `npm run generate` in crates/console/check. Do not edit.\n";

/** Every schema and every definition under its own name; two of one name must be the same. */
function collect() {
  const definitions = {};
  const define = (name, schema) => {
    const known = definitions[name];
    if (known && JSON.stringify(known) !== JSON.stringify(schema)) {
      throw new Error(`two schemas define ${name} differently`);
    }
    definitions[name] = schema;
  };
  for (const message of MESSAGES) {
    const file = new URL(`../../../docs/schemas/${message}.json`, import.meta.url);
    const { $schema, $comment, $defs, title, ...schema } = JSON.parse(readFileSync(file, "utf8"));
    define(title, schema);
    Object.entries($defs ?? {}).forEach(([name, definition]) => define(name, definition));
  }
  return definitions;
}

/**
 * A reference with other keys beside it means both; the generator would read the reference alone. A description beside
 * a reference would make it write the type out once more.
 */
function both(schema) {
  if (Array.isArray(schema)) return schema.map(both);
  if (schema === null || typeof schema !== "object") return schema;
  const inner = Object.fromEntries(Object.entries(schema).map(([key, value]) => [key, both(value)]));
  const { $ref, description, ...rest } = inner;
  if ($ref === undefined) return inner;
  if (Object.keys(rest).length === 0) return { $ref };
  return { description, allOf: [{ $ref }, rest] };
}

async function generate() {
  const schema = { title: "Messages", type: "object", $defs: both(collect()) };
  const text = await compile(schema, "Messages", {
    additionalProperties: false,
    bannerComment: BANNER,
    unreachableDefinitions: true,
    maxItems: 4,
    style: { printWidth: 110 },
  });
  return text
    .replace("export interface Messages {}\n", "")
    .replace(/ \*\n \* This interface was referenced by `Messages`'s JSON-Schema\n \* via the `definition` ".*"\.\n/g, "");
}

const text = await generate();
if (!process.argv.includes("--check")) {
  writeFileSync(OUTPUT, text);
} else if (readFileSync(OUTPUT, "utf8") !== text) {
  console.error("assets/types/messages.d.ts is not what the schemas say: run `npm run generate` and keep the result");
  process.exit(1);
}
