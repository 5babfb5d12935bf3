// Makes the picture of docs/debugging.md with VS Code in headless Chromium: node screenshot.js URL FILE.png
// URL is that of code-server (npm; its native modules need `npm rebuild`) with ?folder= of a project whose main.c is
// tests/emu/dap/program.c, built with -g -O0 to build/firmware.elf; the .vsix is installed in it. Needs playwright-core.
const { chromium } = require('playwright-core');

const [url, file] = process.argv.slice(2);
const LINE = '13';

(async () => {
    const browser = await chromium.launch({
        executablePath: process.env.CHROMIUM || '/usr/bin/chromium', args: ['--no-sandbox', '--disable-gpu'],
    });
    const page = await browser.newPage({ viewport: { width: 1360, height: 900 } });
    page.setDefaultTimeout(90000);
    const keys = async (...names) => {
        for (const name of names) {
            await page.keyboard.press(name);
            await page.waitForTimeout(1000); // the editor drops keys that arrive faster
        }
    };
    await page.goto(url);
    await page.locator('.explorer-folders-view .monaco-list-row', { hasText: 'main.c' }).first().dblclick();
    await page.waitForSelector('.monaco-editor .view-line');
    await page.click('.monaco-editor .view-lines', { position: { x: 200, y: 30 } });
    await keys('Control+G', ...LINE, 'Enter', 'F9', 'Control+Shift+D', 'F5');
    await page.waitForSelector('.debug-call-stack .monaco-list-row');
    for (const title of ['Watch', 'Breakpoints', 'Special Function Registers']) {
        await page.locator('.pane-header', { hasText: title }).first().click();
    }
    await page.locator('.monaco-list-row', { hasText: 'Timer 1' }).first().click();
    await page.locator('.debug-toolbar [aria-label*="Step Back"]').first().click();
    await page.waitForSelector('.statusbar-item:has-text("before the present")');
    await page.waitForSelector('.monaco-list-row:has-text("TMR1")');
    await page.waitForTimeout(1000);
    await page.screenshot({ path: file });
    await browser.close();
})();
