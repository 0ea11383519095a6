const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

exports.activate = () => {
  const command = vscode.workspace.getConfiguration("taskspec").get("command");
  const server = { command, args: ["lsp"] };
  const documentSelector = ["file", "untitled"].map((scheme) => ({ language: "yaml", scheme }));
  client = new LanguageClient("taskspec", "taskspec", server, { documentSelector });
  return client.start();
};

exports.deactivate = () => client?.stop();
