// The page: unpack the episodes, show some of them side by side, and let time run.
import type { Data } from "./data";
import { make } from "./dom";
import { Viewer } from "./viewer";

const OLD =
  "This browser cannot unpack the page: it lacks DecompressionStream, which Chrome and Edge have from 80, " +
  "Safari from 16.4 and Firefox from 113. Open the page in a newer browser, or film the drive: drlsl render.";

async function start(): Promise<void> {
  const main = document.querySelector("main")!;
  const say = (words: string): void => main.replaceChildren(make("p", { class: "problem", role: "alert" }, words));
  if (typeof DecompressionStream === "undefined") {
    say(OLD);
    return;
  }
  try {
    const data = JSON.parse(document.getElementById("data")!.textContent!) as Data;
    const viewer = new Viewer(data, main);
    await viewer.start();
  } catch (problem) {
    say(`This page is damaged: ${problem instanceof Error ? problem.message : problem}. Make it again with drlsl view.`);
  }
}

void start();
