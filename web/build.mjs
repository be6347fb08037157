// Builds the page's script and style: node build.mjs [FOLDER]. The first line of each has the digest of the sources,
// by which a test sees that what ships was built from them.
import { createHash } from "node:crypto";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { build, version } from "esbuild";

const here = import.meta.dirname;
const folder = process.argv[2] ?? join(here, "../drlsl/driving/page/assets");
const sources = [...readdirSync(join(here, "src")).map((name) => `src/${name}`), "build.mjs", "package-lock.json"].sort();
const digest = createHash("sha256");
for (const name of sources) digest.update(`${name}\0`).update(readFileSync(join(here, name))).update("\0");
const head = `/* Built from web/ by esbuild ${version}, sources ${digest.digest("hex")}: npm ci && npm run build */\n`;

for (const [from, to] of [["src/main.ts", "view.js"], ["src/style.css", "view.css"]]) {
  const made = await build({
    entryPoints: [join(here, from)],
    bundle: true,
    minify: true,
    charset: "utf8",
    format: "iife",
    target: "es2020",
    write: false,
    legalComments: "none",
  });
  writeFileSync(join(folder, to), head + made.outputFiles[0].text);
}
