// Starts the Python package's debugger and adds views that the protocol lacks: registers by peripheral and bit field, and
// the simulated time. All data come from requests of the Debug Adapter Protocol; nothing is installed or downloaded.
const { execFile } = require('child_process');
const vscode = require('vscode');

const TYPE = 'openswarm';
const NO_VALUE = '';

/** Returns the command line arguments of the debug adapter for a launch configuration, without the interpreter. */
function wordsOf(configuration) {
    if (!configuration.scene) {
        return ['-m', 'emu', 'debug'];
    }
    const brain = configuration.program || configuration.brain;
    const more = configuration.arenaOptions || [];
    if (!Array.isArray(more) || more.some((word) => !['string', 'number'].includes(typeof word))) {
        throw new Error('arenaOptions must be a list of words, for example ["--seed", "3"]');
    }
    const words = ['-m', 'arena', 'debug', String(configuration.scene), '--robot', String(whole(configuration, 'robot', 0, Infinity))];
    return [...words, ...(brain ? ['--brain', String(brain)] : []), ...more.map(String)];
}

/** Returns an integer of a launch configuration; an input prompt of VS Code yields it as text. */
function whole(configuration, name, least, most) {
    const number = Number(configuration[name] === undefined ? least : configuration[name] === '' ? NaN : configuration[name]);
    if (!Number.isInteger(number) || number < least || number > most) {
        throw new Error(`${name} must be a whole number from ${least}, not ${JSON.stringify(configuration[name])}`);
    }
    return number;
}

/** Returns port and host of an attach configuration. */
function addressOf(configuration) {
    if (configuration.port === undefined) {
        throw new Error('attach needs `port` or `socket`, as given to `emu debug` or `arena debug`');
    }
    return [whole(configuration, 'port', 1, 65535), configuration.host || '127.0.0.1'];
}

/** Checks that this Python has the debugger: VS Code shows no error if an adapter cannot start. */
function started(python, words, cwd) {
    return new Promise((resolve, reject) => execFile(python, [...words.slice(0, 3), '--help'], { cwd }, (error, _said, told) => {
        const why = error && (error.code === 'ENOENT' ? 'there is no such program' : told.trim().split('\n').pop() || error.message);
        return error ? reject(new Error(`${python} does not start the debugger: ${why}. Set openswarm.python to a Python that has OpenSwarm.`)) : resolve();
    }));
}

class Adapters {
    async createDebugAdapterDescriptor(session) {
        const configuration = session.configuration;
        if (configuration.request === 'attach' && configuration.socket) {
            return new vscode.DebugAdapterNamedPipeServer(String(configuration.socket)); // also a Unix socket
        }
        if (configuration.request === 'attach') {
            return new vscode.DebugAdapterServer(...addressOf(configuration));
        }
        const folder = session.workspaceFolder;
        const settings = vscode.workspace.getConfiguration('openswarm', folder);
        const cwd = configuration.cwd || (folder && folder.uri.fsPath);
        const python = configuration.python || settings.get('python');
        const words = wordsOf(configuration);
        await started(python, words, cwd);
        return new vscode.DebugAdapterExecutable(python, words, cwd ? { cwd } : undefined);
    }
}

class Configurations {
    /** Adds missing values; F5 without a configuration debugs the image that the template's Makefile builds. */
    resolveDebugConfiguration(_folder, configuration) {
        if (!configuration.type && !configuration.request) {
            Object.assign(configuration, { type: TYPE, request: 'launch', name: 'Debug the robot' });
        }
        if (configuration.request === 'launch' && !configuration.program && !configuration.scene) {
            configuration.program = '${workspaceFolder}/build/firmware.elf';
        }
        return configuration;
    }
}

/** Tree of peripherals, registers and bit fields from the request `sfrs`, sent when the view is visible. */
class Registers {
    constructor() {
        this.changed = new vscode.EventEmitter();
        this.onDidChangeTreeData = this.changed.event;
        this.session = undefined;
        this.before = new Map();
        this.now = new Map();
    }

    /** Updates the view after the robot has stopped, resumed or disconnected. */
    show(session) {
        this.session = session;
        this.before = this.now;
        this.now = new Map();
        this.changed.fire();
    }

    async getChildren(item) {
        if (item) {
            return item.parts || [];
        }
        if (!this.session) {
            return [];
        }
        try {
            return (await this.session.customRequest('sfrs')).groups;
        } catch {
            return []; // no values while the program runs
        }
    }

    getTreeItem(item) {
        const state = item.parts ? vscode.TreeItemCollapsibleState.Collapsed : vscode.TreeItemCollapsibleState.None;
        const shown = new vscode.TreeItem(item.name, state);
        shown.id = item.path;
        if (item.value !== undefined) {
            this.now.set(item.path, item.value);
            const before = this.before.get(item.path);
            shown.description = before !== undefined && before !== item.value ? `${item.value}  (was ${before})` : item.value;
            shown.tooltip = item.address ? `${item.path} at ${item.address}` : item.path;
            shown.contextValue = 'value';
        }
        return shown;
    }
}

function activate(context) {
    const registers = new Registers();
    const clock = vscode.window.createStatusBarItem(vscode.StatusBarAlignment.Left);
    clock.tooltip = 'Simulated time of the robot';
    clock.command = 'openswarm.goToCycle';

    const said = async (session, text) => (await session.customRequest('evaluate', { expression: text, context: 'repl' })).result;
    const tick = async (session) => {
        clock.text = `$(watch) ${await said(session, '/time')}`;
        clock.show();
    };
    const stands = async (session) => {
        registers.show(session);
        await tick(session);
    };
    const gone = () => {
        registers.show(undefined);
        clock.hide();
    };
    const asked = async (prompt, value) => {
        const session = vscode.debug.activeDebugSession;
        const text = session && session.type === TYPE ? await vscode.window.showInputBox({ prompt, value }) : undefined;
        return text === undefined || text === NO_VALUE ? [] : [session, text];
    };
    const told = (work) => async (...words) => {
        try {
            await work(...words);
        } catch (error) {
            vscode.window.showErrorMessage(error.message);
        }
    };

    context.subscriptions.push(
        clock,
        vscode.debug.registerDebugAdapterDescriptorFactory(TYPE, new Adapters()),
        vscode.debug.registerDebugConfigurationProvider(TYPE, new Configurations()),
        vscode.window.registerTreeDataProvider('openswarm.sfrs', registers),
        vscode.debug.registerDebugAdapterTrackerFactory(TYPE, {
            createDebugAdapterTracker: (session) => ({
                onDidSendMessage: (message) => {
                    if (message.type === 'event' && message.event === 'stopped') {
                        stands(session).catch(gone);
                    } else if (message.type === 'event' && message.event === 'invalidated') {
                        tick(session).catch(gone); // the robot's state is unchanged; its time is now the present
                    }
                },
                onWillStopSession: gone,
            }),
        }),
        vscode.commands.registerCommand('openswarm.setSfr', told(async (item) => {
            const [session, value] = await asked(`New value of ${item.path}, an expression of C`, item.value);
            if (session) {
                await session.customRequest('evaluate', { expression: `${item.path} = ${value}`, context: 'repl' });
                await stands(session);
            }
        })),
        vscode.commands.registerCommand('openswarm.goToCycle', told(async () => {
            const [session, cycle] = await asked('Go to cycle', '');
            if (session) {
                await said(session, `/goto ${cycle}`);
            }
        })),
        vscode.commands.registerCommand('openswarm.lastWrite', told(async () => {
            const [session, place] = await asked('Go back to the instruction that changed this last (a variable or register)', '');
            if (session) {
                await said(session, `/lastwrite ${place}`);
            }
        })),
    );
}

module.exports = { activate, addressOf, started, wordsOf };
