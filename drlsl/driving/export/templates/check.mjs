@HEAD@
//
// Check the decisions of rules.mjs against @COUNT@ stored ones: node check.mjs

import { readFileSync } from "node:fs";
import { decide } from "./rules.mjs";

const ULPS = @ULPS@; // how far exp, sin and the like may be off; all else is exact
const stored = JSON.parse(readFileSync(new URL("decisions.json", import.meta.url)));

function same(one, other) {
  if (typeof one === "number" && typeof other === "number") {
    return one === other || Math.abs(one - other) <= ULPS * 2 ** -52 * Math.max(Math.abs(one), Math.abs(other));
  }
  if (typeof one !== "object" || typeof other !== "object" || one === null || other === null) return one === other;
  const names = Object.keys(one);
  return names.length === Object.keys(other).length && names.every((name) => name in other && same(one[name], other[name]));
}

let wrong = 0;
let undecided = 0;
stored.forEach(({ scene, decision }, place) => {
  const found = decide(scene);
  if ("undecided" in found) {
    undecided += 1;
    return;
  }
  const short = "safe_actions" in found ? found : { [Object.keys(found)[0]]: true };
  if (same(short, decision)) return;
  wrong += 1;
  if (wrong <= 3) console.log(`scene ${place}: ${JSON.stringify(found)}\nexpected ${JSON.stringify(decision)}`);
});
console.log(`${stored.length - wrong - undecided} of ${stored.length} decisions are the stored ones, ${undecided} undecided`);
process.exitCode = wrong === 0 && undecided < stored.length ? 0 : 1;
