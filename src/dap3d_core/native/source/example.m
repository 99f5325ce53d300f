% Runs the model and plots its outputs.
loadlibrary('@FIRST@/@LIBRARY@', 'dap3d.h', 'alias', 'model');
run = calllib('model', 'dap3d_create', @T_END@);
count = calllib('model', 'dap3d_count');
kinds = arrayfun(@(v) calllib('model', 'dap3d_kind', v), 0:count - 1);
outputs = find(kinds == 3) - 1; % DAP3D_OUTPUT
t = linspace(0, @T_END@, 101);
y = zeros(numel(outputs), numel(t));
for k = 1:numel(t)
    if calllib('model', 'dap3d_step_to', run, t(k)) < 0
        error(calllib('model', 'dap3d_message', run));
    end
    y(:, k) = arrayfun(@(v) calllib('model', 'dap3d_get', run, v), outputs);
end
calllib('model', 'dap3d_free', run);
plot(t, y);
legend(arrayfun(@(v) calllib('model', 'dap3d_name', v), outputs, 'UniformOutput', false));
unloadlibrary('model');
