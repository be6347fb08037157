// Measures pages in Chromium without a GPU: CHROMIUM=PATH node measure.mjs PAGE.html ...
// Prints the size, the time from navigation to the first picture, and the pictures a second while it plays.
import { statSync } from "node:fs";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-gpu"],
});
const context = await browser.newContext({ viewport: { width: 1200, height: 900 } });
await context.addInitScript(() => {
  // Once the page is ready, two more frames have put its first picture on the screen.
  new MutationObserver((_, observer) => {
    if (document.documentElement?.dataset.ready === undefined) return;
    observer.disconnect();
    requestAnimationFrame(() => requestAnimationFrame(() => (window.firstPicture = performance.now())));
  }).observe(document, { attributes: true, subtree: true, childList: true });
});
for (const name of process.argv.slice(2)) {
  const first = [];
  let rate = 0;
  for (let n = 0; n < 3; n += 1) {
    const page = await context.newPage();
    await page.goto(pathToFileURL(resolve(name)).href);
    first.push(await page.waitForFunction(() => window.firstPicture).then((value) => value.jsonValue()));
    rate = await page.evaluate(async () => {
      document.querySelector(".play").click();
      const begin = performance.now();
      let pictures = 0;
      while (performance.now() - begin < 4000) {
        await new Promise(requestAnimationFrame);
        pictures += 1;
      }
      return (pictures * 1000) / (performance.now() - begin);
    });
    await page.close();
  }
  const kilobytes = (statSync(name).size / 1000).toFixed(0);
  console.log(`${name}: ${kilobytes} kB, first picture ${Math.min(...first).toFixed(0)} ms (best of 3), ${rate.toFixed(0)} pictures/s`);
}
await browser.close();
