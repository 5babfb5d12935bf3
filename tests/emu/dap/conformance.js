// A complete session with the test-support package of the protocol, over standard streams or, with EMU_PORT, over TCP.
// Run by mocha from test_conformance.py: EMU_PYTHON, EMU_PROGRAM, EMU_SOURCE, EMU_LINES (JSON) and NODE_PATH are set.
const assert = require('assert');
const { DebugClient } = require('@vscode/debugadapter-testsupport');

const program = process.env.EMU_PROGRAM;
const source = process.env.EMU_SOURCE;
const lines = JSON.parse(process.env.EMU_LINES);
const port = process.env.EMU_PORT ? Number(process.env.EMU_PORT) : undefined;

describe('emu debug', function () {
    this.timeout(60000);
    let dc;

    beforeEach(async () => {
        dc = new DebugClient(process.env.EMU_PYTHON, process.env.EMU_LAUNCHER, 'emu', { cwd: process.env.EMU_ROOT }, true);
        dc.defaultTimeout = 30000;
        await dc.start(port);
    });
    afterEach(() => dc.stop());

    it('stops at a breakpoint by hitBreakpoint', () =>
        dc.hitBreakpoint({ program }, { path: source, line: lines.total }));

    it('stops at entry, steps and ends', async () => {
        await Promise.all([
            dc.configurationSequence(),
            dc.launch({ program, stopOnEntry: true }),
            dc.waitForEvent('stopped').then((e) => assert.strictEqual(e.body.reason, 'entry')),
        ]);
        const functions = await dc.setFunctionBreakpointsRequest({ breakpoints: [{ name: 'twice' }] });
        assert.ok(functions.body.breakpoints[0].verified);
        await Promise.all([
            dc.continueRequest({ threadId: 1 }),
            dc.assertStoppedLocation('breakpoint', { path: source, line: lines.once }),
        ]);
        await Promise.all([dc.stepInRequest({ threadId: 1 }), dc.waitForEvent('stopped')]);
        let trace = await dc.stackTraceRequest({ threadId: 1 });
        assert.deepStrictEqual(trace.body.stackFrames.slice(0, 3).map((f) => f.name), ['add', 'twice', 'main']);
        await Promise.all([dc.stepOutRequest({ threadId: 1 }), dc.waitForEvent('stopped')]);
        await dc.setFunctionBreakpointsRequest({ breakpoints: [] });
        await Promise.all([
            dc.stepBackRequest({ threadId: 1 }),
            dc.waitForEvent('stopped').then((e) => assert.strictEqual(e.body.reason, 'step')),
        ]);
        trace = await dc.stackTraceRequest({ threadId: 1, startFrame: 0, levels: 1 });
        const scopes = await dc.scopesRequest({ frameId: trace.body.stackFrames[0].id });
        const locals = await dc.variablesRequest({ variablesReference: scopes.body.scopes[0].variablesReference });
        assert.ok(locals.body.variables.some((v) => v.name === 'n'));
        const value = await dc.evaluateRequest({ expression: 'pairs[2].second', context: 'watch' });
        assert.strictEqual(value.body.result, '30');
        await Promise.all([
            dc.reverseContinueRequest({ threadId: 1 }),
            dc.waitForEvent('stopped').then((e) => assert.strictEqual(e.body.reason, 'entry')),
        ]);
        const rows = await dc.customRequest('disassemble', {
            memoryReference: trace.body.stackFrames[0].instructionPointerReference, instructionOffset: -20, instructionCount: 50,
        });
        assert.strictEqual(rows.body.instructions.length, 50);
        const memory = await dc.customRequest('readMemory', { memoryReference: '0x0800', count: 16 });
        assert.strictEqual(Buffer.from(memory.body.data, 'base64').length, 16);
        await Promise.all([dc.terminateRequest({}), dc.waitForEvent('terminated')]);
    });

    it('tells a fault as an exception', async () => {
        await Promise.all([
            dc.waitForEvent('initialized')
                .then(() => dc.setExceptionBreakpointsRequest({ filters: ['fault'] }))
                .then(() => dc.configurationDoneRequest()),
            dc.launch({ program }),
            dc.waitForEvent('stopped').then((e) => assert.strictEqual(e.body.reason, 'exception')),
            dc.assertOutput('stdout', 'total 8\n', 30000),
        ]);
        const info = await dc.exceptionInfoRequest({ threadId: 1 });
        assert.match(info.body.description, /reading 2 bytes at 0x3009/);
    });
});
