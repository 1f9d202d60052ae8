// Somebody who reads the pages of the console in a browser, and keeps pictures.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { setTimeout as sleep } from 'node:timers/promises';

export const kPatience = 120_000;

// Asks again and again until the answer is one.
export async function until(what, ask) {
  const end = Date.now() + kPatience;
  for (;;) {
    const answer = await ask();
    if (answer) return answer;
    assert.ok(Date.now() < end, 'never came: ' + what);
    await sleep(1);
  }
}

export class Reader {
  constructor(page, base, screenshots) {
    this.page = page;
    this.base = base;
    this.screenshots = screenshots;
    this.problems = [];
    this.expectProblems = false;
    page.on('pageerror', (error) => this.problems.push(String(error)));
    page.on('console', (message) => {
      if (message.type() === 'error' && !this.expectProblems) {
        this.problems.push(message.text());
      }
    });
    page.on('request', (request) => {
      const { origin, protocol } = new URL(request.url());
      if (protocol !== 'data:' && origin !== base) {
        this.problems.push('asks elsewhere: ' + request.url());
      }
    });
  }

  async open(path, heading) {
    await this.page.goto(this.base + path);
    await this.heading(heading);
  }
  // A page that only has to show what it should.
  async shows(path, heading, texts, picture) {
    await this.open(path, heading);
    for (const text of texts) await this.sees(text);
    if (picture) await this.picture(picture);
  }
  // What the pages read.
  async api(path) {
    return (await fetch(this.base + '/api/v1/' + path)).json();
  }
  // Makes a change as the pages do.
  async change(method, path, body) {
    const response = await fetch(this.base + '/api/v1/' + path, {
      method,
      headers: { 'Content-Type': 'application/json', 'X-Selfcal-Console': '1' },
      body: JSON.stringify(body),
    });
    const text = await response.text();
    assert.equal(response.status, 200, text);
    return JSON.parse(text);
  }
  async heading(text) {
    await this.page
      .getByRole('heading', { level: 1, name: text, exact: true })
      .waitFor({ timeout: kPatience });
  }
  async sees(text) {
    await this.page.getByText(text).filter({ visible: true }).first().waitFor({ timeout: kPatience });
  }
  // Until nothing is being read.
  async settled() {
    const reads = this.page.getByText(/^(Loading|Simulating)/);
    await until('the whole page', async () => (await reads.count()) === 0);
  }
  // Until what stands first in each row is as it should be.
  async rows(areRight) {
    let names = [];
    await until('the right rows', async () => {
      names = await this.page.locator('tbody th').allTextContents();
      return areRight(names);
    });
    return names;
  }
  async picture(name) {
    // Chromium draws the page in front alone.
    await this.page.bringToFront();
    for (const scheme of ['light', 'dark']) {
      await this.page.emulateMedia({ colorScheme: scheme });
      await this.page.waitForTimeout(200);
      await this.page.screenshot({
        path: join(this.screenshots, `${name}-${scheme}.png`),
        fullPage: true,
      });
    }
    await this.page.emulateMedia({ colorScheme: 'light' });
    await this.usable(name);
  }
  // What the window shows, for docs/pictures.
  async detail(name) {
    await this.page.bringToFront();
    await this.page.screenshot({ path: join(this.screenshots, `${name}-detail.png`) });
  }
  // What a screen reader needs: one heading of the page, names for controls,
  // heads for tables, and nothing that is wider than the window.
  async usable(name) {
    const found = await this.page.evaluate(() => {
      const named = (e) =>
        e.labels?.length > 0 || e.getAttribute('aria-label') || e.textContent.trim();
      const all = (query) => [...document.querySelectorAll(query)];
      return {
        headings: all('h1').length,
        nameless: all('input, select, textarea, button, meter')
          .filter((e) => !named(e)).map((e) => e.outerHTML),
        headless: all('table:not(.u-legend)').filter((t) => !t.querySelector('th[scope=col]')).length,
        pictures: all('[role=img]').filter((e) => !e.getAttribute('aria-label')).length,
        wide: document.documentElement.scrollWidth - innerWidth,
      };
    });
    assert.deepEqual(
      { ...found, wide: Math.max(0, found.wide) },
      { headings: 1, nameless: [], headless: 0, pictures: 0, wide: 0 },
      name,
    );
  }
}
