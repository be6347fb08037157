// The page in a real Chromium, by clicks and keys: PAGES=FOLDER CHROMIUM=PATH node --test web/test
import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const { PAGES, CHROMIUM } = process.env;
let browser;

before(async () => {
  browser = await chromium.launch({ executablePath: CHROMIUM, args: ["--no-sandbox", "--disable-gpu"] });
});

after(() => browser.close());

// Opens a page; at the end nothing may have gone wrong there, and nothing may have been asked of any network.
async function open(name, act, { hash = "", script, ...options } = {}) {
  const context = await browser.newContext({ viewport: { width: 1200, height: 900 }, ...options });
  const page = await context.newPage();
  const problems = [];
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("console", (message) => message.type() === "error" && problems.push(message.text()));
  page.on("request", (request) => /^(file|blob|data):/.test(request.url()) || problems.push(request.url()));
  if (script !== undefined) await page.addInitScript(script);
  await page.goto(pathToFileURL(join(PAGES, name)).href + hash);
  await page.locator("html[data-ready], .problem").first().waitFor();
  await act(page);
  assert.deepEqual(problems, []);
  await context.close();
}

const badges = (page) => page.locator(".badge").allInnerTexts();
const left = (page) => page.locator(".action").nth(1);
const time = async (page) => Number((await page.locator(".clock").innerText()).split(" ")[0]);

// The place of a vehicle in the picture: the pointer tells over which one it is.
async function find(page, id) {
  const found = await page.evaluate((wanted) => {
    const canvas = document.querySelector("canvas.road");
    const edges = canvas.getBoundingClientRect();
    for (let y = edges.top; y < edges.bottom; y += 5) {
      for (let x = edges.left; x < edges.right; x += 5) {
        canvas.dispatchEvent(new PointerEvent("pointermove", { clientX: x, clientY: y }));
        if (canvas.dataset.over === wanted) return [x + 10, y + 10];
      }
    }
    return null;
  }, id);
  assert.ok(found, `there is no ${id} in the picture`);
  return found;
}

async function editable(page) {
  await page.getByRole("button", { name: "What if …" }).first().waitFor();
}

test("a newcomer reads why the car does not change lanes", () =>
  open("scene.html", async (page) => {
    assert.deepEqual(await badges(page), ["offered", "not offered", "offered"]);
    const why = await left(page).innerText();
    assert.match(why, /sports_car is 33\.4 m away, 89\.5 m needed: 56\.1 m missing/);
    assert.match(why, /highway\.pl:262\nobjection\(Action, too_close\(Car, Gap, Needed\)\)/);
    assert.match(await page.locator("canvas.road").getAttribute("aria-label"), /left lane change is refused because sports_car/);
  }));

test("a lane that ends has grass beyond its end", () =>
  open("ramp.html", async (page) => {
    // Along the middle of the road's lowest lane: asphalt, the line at its end, grass.
    const changes = await page.evaluate(() => {
      const canvas = document.querySelector("canvas.road");
      const context = canvas.getContext("2d");
      const row = (top) => [...Array(canvas.width).keys()].map((x) => context.getImageData(x, top, 1, 1).data.slice(0, 3).join());
      const grass = row(1)[0];
      const column = [...Array(canvas.height).keys()].map((y) => context.getImageData(2, y, 1, 1).data.slice(0, 3).join());
      const bottom = column.findLastIndex((colour) => colour !== grass);
      const colours = row(bottom - 12);
      return { first: colours[2] === grass, last: colours.at(-3) === grass, from: colours.indexOf(grass) / canvas.width };
    });
    assert.deepEqual([changes.first, changes.last], [false, true]);
    assert.ok(changes.from > 0.5 && changes.from < 0.95, `${changes.from}`);
  }));

test("it plays, pauses, steps and scrubs", () =>
  open("drives.html", async (page) => {
    assert.equal(await time(page), 0);
    await page.keyboard.press("Space");
    await page.waitForFunction(() => parseFloat(document.querySelector(".clock").textContent) > 0.5);
    await page.getByRole("button", { name: "Pause" }).click();
    const paused = await time(page);
    await page.waitForTimeout(100);
    assert.equal(await time(page), paused);
    await page.locator("body").click({ position: { x: 5, y: 5 } });
    await page.keyboard.press("Home");
    await page.keyboard.press("ArrowRight");
    assert.equal(await time(page), 0.1);
    await page.keyboard.press("Shift+ArrowRight");
    assert.equal(await time(page), 1.1);
    await page.getByRole("button", { name: "A frame back" }).click();
    assert.equal(await time(page), 1);
    const range = await page.getByRole("slider", { name: "Time" }).boundingBox();
    await page.mouse.click(range.x + range.width / 2, range.y + range.height / 2);
    const duration = Number((await page.locator(".clock").innerText()).split(" ")[2]);
    assert.ok(Math.abs((await time(page)) - duration / 2) < duration / 20);
    await page.keyboard.press("End");
    assert.ok(Math.abs((await time(page)) - duration) < 0.06);
    const last = await page.locator(".facts").first().innerText();
    await page.keyboard.press("Home");
    assert.notEqual(await page.locator(".facts").first().innerText(), last);
  }));

test("speeds, marks and the time line", () =>
  open("busy.html", async (page) => {
    await page.keyboard.press("+");
    assert.equal(await page.getByRole("combobox", { name: "Speed" }).inputValue(), "2");
    await page.keyboard.press("n");
    const first = await time(page);
    assert.ok(first > 0);
    assert.match(await page.locator(".spoken").textContent(), /lane change begins|not offered/);
    await page.getByRole("button", { name: "To the next mark" }).click();
    assert.ok((await time(page)) > first);
    await page.keyboard.press("p");
    assert.equal(await time(page), first);
    const line = await page.locator("canvas.timeline").boundingBox();
    await page.mouse.click(line.x + line.width / 4, line.y + 8);
    const duration = Number((await page.locator(".clock").innerText()).split(" ")[2]);
    assert.ok(Math.abs((await time(page)) - duration / 4) < 0.5);
  }));

test("an intervention is marked where the rules did not offer what was wanted most", () =>
  open("stubborn.html", async (page) => {
    await page.keyboard.press("n");
    assert.match(await page.locator(".spoken").textContent(), /^wanted what was not offered/);
    assert.match(await left(page).innerText(), /not offered\s+wants 1\.00 \(best\)/);
    assert.match(await page.locator(".action").first().innerText(), /offered\s+chosen/);
  }));

test("episodes stand side by side, and are chosen, added and closed", () =>
  open("drives.html", async (page) => {
    assert.equal(await page.locator("article").count(), 2);
    await page.getByRole("combobox", { name: "Episode" }).first().selectOption("1");
    assert.match(await page.locator("article").first().getAttribute("aria-label"), /shield on/);
    await page.getByRole("button", { name: "Show one more episode" }).click();
    assert.equal(await page.locator("article").count(), 3);
    await page.getByRole("button", { name: "Close this episode" }).last().click();
    assert.equal(await page.locator("article").count(), 2);
  }));

test("an address says what opens, and when", () =>
  open(
    "drives.html",
    async (page) => {
      assert.equal(await page.locator("article").count(), 1);
      assert.equal(await time(page), 2.5);
    },
    { hash: "#episode=2&time=2.5" },
  ));

test("a car is dragged until an action flips, and the reason is read", () =>
  open("scene.html", async (page) => {
    await editable(page);
    const [x, y] = await find(page, "sports_car");
    await page.mouse.move(x, y);
    await page.mouse.down();
    let gone = 0;
    while ((await badges(page))[1] === "not offered") {
      gone += 10;
      assert.ok(gone < 1000, "dragging it away changes nothing");
      await page.mouse.move(x - gone, y);
    }
    assert.ok(gone > 100);
    await page.mouse.move(x - gone + 30, y);
    const [, , missing] = /([\d.]+) m needed: ([\d.]+) m missing/.exec(await left(page).innerText());
    assert.ok(Number(missing) < 5);
    await page.mouse.up();
    await page.getByRole("button", { name: "Undo all changes" }).click();
    assert.match(await left(page).innerText(), /56\.1 m missing/);
  }));

test("the ego is dragged into another lane", () =>
  open("scene.html", async (page) => {
    await editable(page);
    const [x, y] = await find(page, "ego");
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x, y + 45, { steps: 4 });
    await page.mouse.up();
    const scene = JSON.parse(await page.locator("textarea").inputValue());
    assert.equal(scene.ego.target_lane, undefined);
    assert.match(await page.locator(".action").nth(2).innerText(), /not offered\nno lane/);
  }));

test("a scene that cannot be decided shows the fail-safe, never a decision", () =>
  open("scene.html", async (page) => {
    await editable(page);
    await page.getByRole("button", { name: "What if …" }).click();
    await page.getByLabel("across, m").fill("99");
    assert.match(await page.locator(".panel > .alarm").innerText(), /fail-safe: ego\.y_m is in no lane of the road/);
    assert.deepEqual(await badges(page), ["not offered", "not offered", "not offered"]);
    await page.getByLabel("across, m").fill("16.125");
    await page.getByLabel("speed, m/s").fill("1e17");
    assert.match(await page.locator(".panel > .alarm").innerText(), /fail-safe: only the interpreter can tell/);
    assert.deepEqual(await badges(page), ["offered", "not offered", "not offered"]);
  }));

test("by keys: a vehicle is chosen, moved, slowed, added and removed", () =>
  open("scene.html", async (page) => {
    await editable(page);
    await page.getByRole("button", { name: "What if …" }).click();
    await page.locator("canvas.road").focus();
    while ((await page.getByLabel("vehicle").inputValue()) !== "sports_car") await page.keyboard.press("]");
    const away = async () => Number(await page.getByLabel("ahead of the ego").inputValue());
    const begin = await away();
    await page.keyboard.press("ArrowLeft");
    assert.ok(Math.abs((await away()) - begin + 1) < 0.01);
    for (let n = 0; n < 6; n += 1) await page.keyboard.press("Shift+ArrowLeft");
    assert.equal((await badges(page))[1], "offered");
    for (let n = 0; n < 7; n += 1) await page.keyboard.press("+");
    assert.equal((await badges(page))[1], "not offered");
    assert.match(await page.locator(".spoken").textContent(), /The rules decide otherwise now/);
    await page.keyboard.press("Delete");
    assert.equal((await badges(page))[1], "offered");
    await page.keyboard.press("a");
    assert.equal(await page.getByLabel("vehicle").inputValue(), "new1");
    await page.getByLabel("speed, m/s").fill("5");
    assert.match(await page.locator(".facts").innerText(), /target (1|2)\d\.\d m\/s · changed by you/);
    await page.locator("canvas.road").focus();
    await page.keyboard.press("Escape");
    assert.match(await left(page).innerText(), /56\.1 m missing/);
  }));

test("a scene is copied as scene.json, and pasted back", () =>
  open(
    "scene.html",
    async (page) => {
      await editable(page);
      await page.getByRole("button", { name: "What if …" }).click();
      await page.getByLabel("vehicle").selectOption("sports_car");
      await page.getByLabel("speed, m/s").fill("34.5");
      await page.getByRole("button", { name: "Copy as scene.json" }).click();
      const copied = await page.evaluate(() => navigator.clipboard.readText());
      const scene = JSON.parse(copied);
      assert.equal(scene.vehicles.find((one) => one.id === "sports_car").vx_mps, 34.5);
      // The test in Python asks the interpreter about this scene.
      writeFileSync(join(PAGES, "copied.json"), copied);
      writeFileSync(join(PAGES, "copied.txt"), await left(page).innerText());
      await page.getByText("scene.json", { exact: true }).last().click();
      const without = { ...scene, vehicles: [] };
      await page.locator("textarea").fill(JSON.stringify(without));
      await page.getByRole("button", { name: "Use this text" }).click();
      assert.deepEqual(await badges(page), ["offered", "offered", "offered"]);
      await page.locator("textarea").fill('{"road": {}}');
      await page.getByRole("button", { name: "Use this text" }).click();
      assert.match(await page.locator(".edit .alarm").innerText(), /This is no scene: road\.lanes is no list of lanes/);
    },
    { permissions: ["clipboard-read", "clipboard-write"] },
  ));

test("a drive is changed at the moment at which it stands", () =>
  open(
    "drives.html",
    async (page) => {
      await editable(page);
      const before = await badges(page);
      await page.getByRole("button", { name: "What if …" }).first().click();
      assert.deepEqual((await badges(page)).slice(0, 3), before.slice(0, 3));
      assert.match(await page.locator(".facts").first().innerText(), /changed by you/);
    },
    { hash: "#episode=1&time=3" },
  ));

test("rules that cannot be lowered: it plays, and says why nothing can be dragged", () =>
  open("interpreted.html", async (page) => {
    const words = await page.locator(".tools").innerText();
    assert.match(words, /Vehicles cannot be dragged here: these rules run only in the interpreter: .*interpreted\.pl:\d+/);
    await page.keyboard.press("Space");
    await page.waitForFunction(() => parseFloat(document.querySelector(".clock").textContent) > 0.2);
  }));

test("rules that changed since the drive: it says so", () =>
  open("changed.html", async (page) => {
    assert.match(await page.locator(".tools").first().innerText(), /the rules are not those that drove: highway\.pl, .* changed since/);
  }));

test("a browser without DecompressionStream is told what to do", () =>
  open(
    "scene.html",
    async (page) => {
      assert.match(await page.getByRole("alert").innerText(), /lacks DecompressionStream.*Open the page in a newer browser/);
    },
    { script: "delete window.DecompressionStream" },
  ));

for (const [what, options] of [
  ["a phone", { viewport: { width: 360, height: 740 }, hasTouch: true, isMobile: true }],
  ["the dark", { colorScheme: "dark" }],
]) {
  test(`on ${what}`, () =>
    open(
      "drives.html",
      async (page) => {
        const look = await page.evaluate(() => ({
          over: document.documentElement.scrollWidth - window.innerWidth,
          back: getComputedStyle(document.body).backgroundColor,
        }));
        assert.ok(look.over <= 0, `${look.over} pixels wider than the window`);
        const [red] = /\d+/.exec(look.back);
        assert.equal(Number(red) < 60, options.colorScheme === "dark");
      },
      options,
    ));
}

test("every control has a name", () =>
  open("drives.html", async (page) => {
    await editable(page);
    await page.getByRole("button", { name: "What if …" }).first().click();
    const nameless = await page.evaluate(() =>
      [...document.querySelectorAll("button, select, input, textarea, canvas:not([aria-hidden])")]
        .filter((one) => !(one.getAttribute("aria-label") || one.labels?.[0]?.textContent.trim() || one.textContent.trim()))
        .map((one) => one.outerHTML),
    );
    assert.deepEqual(nameless, []);
  }));
