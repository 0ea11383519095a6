// Bundle CodeMirror for `taskspec studio`: `npm install && npm run build` in this folder, with the versions of package.json.
// Writes codemirror.js, and codemirror.licences.txt with the licence of each package in it, to taskspec/tools/studio/static/.
import { build } from "esbuild";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";

const out = "../../../taskspec/tools/studio/static/codemirror.js";
const { metafile } = await build({
  entryPoints: ["codemirror.js"],
  outfile: out,
  bundle: true,
  format: "esm",
  minify: true,
  target: "es2022",
  legalComments: "none",
  metafile: true,
});

function licence(folder) {
  const { name, version } = JSON.parse(readFileSync(`${folder}/package.json`, "utf8"));
  const file = readdirSync(folder).find((each) => /^licen[cs]e/i.test(each));
  return `${name} ${version}\n\n${readFileSync(`${folder}/${file}`, "utf8").trim()}\n`;
}

const inputs = Object.entries(metafile.outputs[out].inputs).filter(([, input]) => input.bytesInOutput > 0);
const folders = inputs.map(([path]) => path.match(/^node_modules\/(?:@[^/]+\/)?[^/]+/)?.[0]).filter(Boolean);
const texts = [...new Set(folders)].sort().map(licence);
writeFileSync(out.replace(".js", ".licences.txt"), texts.join(`\n${"-".repeat(79)}\n\n`));
