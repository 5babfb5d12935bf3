// Debugs one robot of a swarm with the protocol's test-support package: forward, back with the whole world, forward.
// Run by mocha from test_rewind.py: EMU_PYTHON, EMU_LAUNCHER (starts `arena debug`), EMU_ROOT and NODE_PATH are set.
const assert = require('assert');
const { DebugClient } = require('@vscode/debugadapter-testsupport');

describe('arena debug', function () {
    this.timeout(120000);
    let dc;

    const world = async () =>
        (await dc.evaluateRequest({ expression: '/world', context: 'repl' })).body.result;
    const moved = async (request) => {
        const [, stopped] = await Promise.all([request, dc.waitForEvent('stopped')]);
        return stopped.body.reason;
    };

    it('takes the whole world back and forth', async () => {
        dc = new DebugClient(process.env.EMU_PYTHON, process.env.EMU_LAUNCHER, 'arena', { cwd: process.env.EMU_ROOT }, true);
        dc.defaultTimeout = 60000;
        await dc.start();
        await Promise.all([
            dc.configurationSequence(),
            dc.launch({ stopOnEntry: true }),
            dc.waitForEvent('stopped').then((e) => assert.strictEqual(e.body.reason, 'entry')),
        ]);
        const begin = await world();
        await dc.setFunctionBreakpointsRequest({ breakpoints: [{ name: 'react' }] });
        const passes = [];
        for (let pass = 0; pass < 3; pass++) {
            assert.strictEqual(await moved(dc.continueRequest({ threadId: 1 })), 'breakpoint');
            passes.push(await world());
        }
        assert.strictEqual(new Set([begin, ...passes]).size, 4);
        for (const expected of [passes[1], passes[0]]) {
            assert.strictEqual(await moved(dc.reverseContinueRequest({ threadId: 1 })), 'breakpoint');
            assert.strictEqual(await world(), expected);
        }
        assert.strictEqual(await moved(dc.reverseContinueRequest({ threadId: 1 })), 'entry');
        assert.strictEqual(await world(), begin);
        for (const expected of passes) {
            assert.strictEqual(await moved(dc.continueRequest({ threadId: 1 })), 'breakpoint');
            assert.strictEqual(await world(), expected);
        }
        assert.strictEqual(await moved(dc.nextRequest({ threadId: 1 })), 'step');
        assert.notStrictEqual(await world(), passes[2]);
        assert.strictEqual(await moved(dc.stepBackRequest({ threadId: 1 })), 'step');
        assert.strictEqual(await world(), passes[2]);
        await dc.setFunctionBreakpointsRequest({ breakpoints: [] });
        await dc.disconnectRequest({ terminateDebuggee: false });
    });
});
