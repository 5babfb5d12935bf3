// Makes two pictures of docs/debugging.md with VS Code in headless Chromium: node screenshot.js URL FILE.png [threads]
// URL is that of code-server (npm; its native modules are built with node-gyp) with ?folder= of a project. The .vsix is
// installed in it, openswarm.python is set, files.autoSave is off. Needs playwright-core.
// Without `threads`: main.c is tests/emu/dap/program.c, built with -g -O0 to build/firmware.elf.
// With `threads`: the project is the folder that `openswarm new` makes.
const { chromium } = require('playwright-core');

const [url, file, session] = process.argv.slice(2);

/** Presses keys one after the other. */
async function press(page, ...names) {
    for (const name of names) {
        await page.keyboard.press(name);
        await page.waitForTimeout(1000); // the editor drops keys that arrive faster
    }
}

/** Types a line of text and ends it with Enter; Escape closes the list of completions before. */
async function enter(page, text, ...before) {
    await page.keyboard.type(text, { delay: 50 });
    await page.waitForTimeout(1000);
    await press(page, ...before, 'Enter');
}

/** Runs a command of the palette. */
async function command(page, name) {
    await press(page, 'F1');
    await page.waitForSelector('.quick-input-widget input'); // else the editor takes the text
    await enter(page, name);
    await page.waitForTimeout(2000);
}

/** Opens main.c at a line. */
async function open(page, line) {
    const row = (text) => page.locator('.explorer-folders-view .monaco-list-row', { hasText: text }).first();
    if (session === 'threads') {
        await row('src').click();
    }
    await row('main.c').dblclick();
    await page.waitForSelector('.monaco-editor .view-line');
    await page.click('.monaco-editor .view-lines', { position: { x: 200, y: 30 } });
    await press(page, 'Control+G');
    await enter(page, line);
}

/** Starts the debugger and waits until the robot is paused. */
async function start(page) {
    await press(page, 'Control+Shift+D', 'F5');
    await page.waitForSelector('.debug-call-stack .monaco-list-row');
    await page.waitForTimeout(3000); // the editor opens the line
    await page.locator('.pane-header', { hasText: 'Watch' }).first().click();
}

/** One line back in time, with the registers of timer 1. */
async function stepBack(page) {
    await open(page, '13');
    await press(page, 'F9');
    await start(page);
    for (const title of ['Breakpoints', 'Special Function Registers']) {
        await page.locator('.pane-header', { hasText: title }).first().click();
    }
    await page.locator('.monaco-list-row', { hasText: 'Timer 1' }).first().click();
    await page.locator('.debug-toolbar [aria-label*="Step Back"]').first().click();
    await page.waitForSelector('.statusbar-item:has-text("before the present")');
    await page.waitForSelector('.monaco-list-row:has-text("TMR1")');
}

/** A conditional breakpoint in an event handler: threads, machine code beside source, C expressions in the console. */
async function threads(page) {
    await open(page, '28');
    await command(page, 'Debug: Add Conditional Breakpoint');
    await enter(page, 'data->value == 3');
    await start(page);
    await command(page, 'Open Disassembly View');
    await command(page, 'Debug Console: Focus on Debug Console View');
    for (const line of ['data->value * 1000', '/threads', '/time']) {
        await enter(page, line, 'Escape');
    }
}

(async () => {
    const browser = await chromium.launch({
        executablePath: process.env.CHROMIUM || '/usr/bin/chromium', args: ['--no-sandbox', '--disable-gpu'],
    });
    const page = await browser.newPage({ viewport: { width: 1360, height: 900 } });
    page.setDefaultTimeout(90000);
    await page.goto(url);
    await (session === 'threads' ? threads : stepBack)(page);
    await page.waitForTimeout(1000);
    await page.screenshot({ path: file });
    await browser.close();
})();
