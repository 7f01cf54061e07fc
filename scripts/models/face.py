"""Makes the face of lesson 19: python3 scripts/models/face.py writes face.gltf beside this file.

A dome with a mouth, eyes and brows that lie on it; each morph target moves points along the dome.
"""
import math,struct,base64,json,pathlib
V=[];N=[];C=[];I=[];part=[]
def v(p,n,c,k): V.append(p);N.append(n);C.append(c);part.append(k);return len(V)-1
skin=(240,200,150,255);dark=(110,45,50,255);white=(250,250,248,255);black=(35,30,40,255);brow=(95,60,40,255)
rx,ry,rz=0.24,0.3,0.16
def dome(x,y):
    q=1-(x/rx)**2-(y/ry)**2
    return rz*math.sqrt(max(q,0))
def nrm(x,y):
    z=dome(x,y); n=(x/rx**2,y/ry**2,max(z,0.02)/rz**2); l=math.sqrt(sum(a*a for a in n)); return tuple(a/l for a in n)
# dome: rings
R,S=6,20
LIN=lambda c:tuple(round(255*((u/255/12.92) if u<11 else ((u/255+0.055)/1.055)**2.4)) for u in c[:3])+(255,)
skin,dark,white,black,brow=map(LIN,(skin,dark,white,black,brow))
c0=v((0,0,rz),(0,0,1),skin,'skin')
prev=None
for r in range(1,R+1):
    t=math.sin(r/R*math.pi/2)
    ring=[]
    for s in range(S):
        a=2*math.pi*s/S
        x,y=rx*t*math.cos(a),ry*t*math.sin(a)
        ring.append(v((x,y,dome(x*0.99999,y*0.99999)),nrm(x,y),skin,'skin'))
    for s in range(S):
        n=(s+1)%S
        if prev is None: I+= [c0,ring[s],ring[n]]
        else: I+= [prev[s],ring[s],ring[n], prev[s],ring[n],prev[n]]
    prev=ring
# back cap
cb=v((0,0,-0.06),(0,0,-1),skin,'skin')
back=[v(V[i],(0,0,-1),skin,'skin') for i in prev]
for s in range(S): I+=[cb,back[(s+1)%S],back[s]]
def on(x,y,up=0.006): return (x,y,dome(x,y)+up)
# mouth
M=13; mouth={}
top=[];bot=[]
for i in range(M):
    u=-1+2*i/(M-1); x=0.1*u; y=-0.135-0.0*u; h=0.011*(1-u*u)**0.5+0.003
    top.append(v(on(x,y+h),nrm(x,y),dark,'mouthtop')); bot.append(v(on(x,y-h),nrm(x,y),dark,'mouthbot'))
for i in range(M-1): I+=[top[i],bot[i],bot[i+1],top[i],bot[i+1],top[i+1]]
# eyes
def disc(cx,cy,r,col,k,up,seg=12):
    c=v(on(cx,cy,up),nrm(cx,cy),col,k)
    ring=[v(on(cx+r*math.cos(2*math.pi*s/seg),cy+r*1.1*math.sin(2*math.pi*s/seg),up),nrm(cx,cy),col,k) for s in range(seg)]
    for s in range(seg): I.extend([c,ring[s],ring[(s+1)%seg]])
for side,k in ((1,'L'),(-1,'R')):
    disc(0.09*side,0.06,0.042,white,'eye'+k,0.006)
    disc(0.09*side,0.058,0.02,black,'eye'+k,0.010,10)
    t=[];b=[]
    for i in range(5):
        x=side*(0.045+0.095*i/4); y=0.135+0.014*math.sin(math.pi*i/4)
        t.append(v(on(x,y+0.009),nrm(x,y),brow,'brow'+k)); b.append(v(on(x,y-0.009),nrm(x,y),brow,'brow'+k))
    for i in range(4):
        q=[t[i],b[i],b[i+1],t[i],b[i+1],t[i+1]]
        I+= q if side>0 else [q[j] for j in (0,2,1,3,5,4)]
names=["smileLeft","smileRight","browUpLeft","browUpRight","blinkLeft","blinkRight","open"]
T=[]
for n in names:
    d=[]
    side=1 if n.endswith("Left") else -1
    for p,k in zip(V,part):
        x,y,z=p; o=(0,0,0)
        def to(nx,ny):
            up=z-dome(x,y)
            return (nx-x,ny-y,dome(nx,ny)+up-z)
        if n.startswith("smile") and k.startswith("mouth"):
            w=max(0,side*x/0.1)
            w=w*w
            o=to(x+side*0.025*w,y+0.06*w)
        elif n.startswith("brow") and k=='brow'+('L' if side>0 else 'R'): o=to(x,y+0.035)
        elif n.startswith("blink") and k=='eye'+('L' if side>0 else 'R'): o=to(x,y+(0.06-y)*0.88)
        elif n=="open" and k=='mouthbot': o=to(x,y-0.07*max(0,1-(x/0.1)**2))
        elif n=="open" and k=='mouthtop': o=to(x,y+0.008*max(0,1-(x/0.1)**2))
        d.append(o)
    T.append(d)
# ear: small box-ish ellipsoid octahedron
EV=[(0.03,0,0),(-0.03,0,0),(0,0.06,0),(0,-0.06,0),(0,0,0.03),(0,0,-0.03)]
EN=[tuple((1 if a>0 else -1 if a<0 else 0) for a in p) for p in EV]
EI=[0,2,4,4,2,1,1,2,5,5,2,0,4,3,0,1,3,4,5,3,1,0,3,5]
buf=bytearray();views=[];acc=[]
def add(data,comp,typ,count,mm=None,norm=False,target=None):
    while len(buf)%4: buf.append(0)
    views.append({"buffer":0,"byteOffset":len(buf),"byteLength":len(data)}); buf.extend(data)
    a={"bufferView":len(views)-1,"componentType":comp,"count":count,"type":typ}
    if mm: a["min"],a["max"]=mm
    if norm: a["normalized"]=True
    acc.append(a); return len(acc)-1
def f(rows): return b"".join(struct.pack("<%df"%len(r),*r) for r in rows)
def r3(rows): return [tuple(float("%.4f"%a) for a in r) for r in rows]
def mm(rows): 
    rows=[struct.unpack("<3f",struct.pack("<3f",*r)) for r in rows]
    return ([min(c) for c in zip(*rows)],[max(c) for c in zip(*rows)])
V=r3(V); T=[r3(t) for t in T]
pos=add(f(V),5126,"VEC3",len(V),mm(V)); nor=add(f(N),5126,"VEC3",len(N)); col=add(b"".join(struct.pack("4B",*c) for c in C),5121,"VEC4",len(C),norm=True)
idx=add(struct.pack("<%dH"%len(I),*I),5123,"SCALAR",len(I))
tg=[{"POSITION":add(f(t),5126,"VEC3",len(t),mm(t))} for t in T]
epos=add(f(EV),5126,"VEC3",6,mm(EV)); enor=add(f([tuple(a/1 for a in n) for n in EN]),5126,"VEC3",6); eidx=add(struct.pack("<24H",*EI),5123,"SCALAR",24)
anims=[]
def anim(name,keys,turns):
    ts=[k[0] for k in keys]
    ti=add(f([(t,) for t in ts]),5126,"SCALAR",len(ts),([ts[0]],[ts[-1]]))
    w=add(f([k[1] for k in keys]),5126,"SCALAR",len(ts)*7)
    q=add(f([(0,0,math.sin(math.radians(d)/2),math.cos(math.radians(d)/2)) for d in turns]),5126,"VEC4",len(ts))
    anims.append({"name":name,"samplers":[{"input":ti,"output":w},{"input":ti,"output":q}],"channels":[{"sampler":0,"target":{"node":0,"path":"weights"}},{"sampler":1,"target":{"node":0,"path":"rotation"}}]})
z=[0]*7
anim("Wink",[(0,z),(0.4,[0.9,0.2,0,1,0,0,0]),(0.55,[1,0.2,0,1,1,0,0.2]),(0.95,[1,0.2,0,1,1,0,0.2]),(1.1,[0.9,0.2,0,0.6,0,0,0]),(1.6,z)],[0,-8,-12,-12,-8,0])
anim("Talk",[(0,[0.1,0.1,0,0,0,0,0]),(0.25,[0,0,0.3,0.3,0,0,1]),(0.5,[0.3,0.3,0,0,0,0,0.15]),(0.75,[0,0,0.2,0.2,0,0,0.8]),(1.0,[0.1,0.1,0,0,0,0,0])],[0,2,0,-2,0])
anim("Frown",[(0,[-0.7,-0.7,-0.5,-0.5,0.25,0.25,0]),(1.0,[-0.8,-0.8,-0.6,-0.6,0.35,0.35,0]),(2.0,[-0.7,-0.7,-0.5,-0.5,0.25,0.25,0])],[0,0,0])
j={"asset":{"version":"2.0","generator":"the project itself"},"scene":0,"scenes":[{"nodes":[0]}],
"nodes":[{"name":"Face","mesh":0,"children":[1,2]},{"name":"LeftEar","translation":[0.25,0.0,0.0],"mesh":1},{"name":"RightEar","translation":[-0.25,0.0,0.0],"mesh":1}],
"meshes":[{"name":"Face","extras":{"targetNames":names},"weights":z,"primitives":[{"attributes":{"POSITION":pos,"NORMAL":nor,"COLOR_0":col},"indices":idx,"targets":tg,"material":0}]},
{"name":"Ear","primitives":[{"attributes":{"POSITION":epos,"NORMAL":enor},"indices":eidx,"material":1}]}],
"materials":[{"name":"paint","pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0.8}},{"name":"skin","pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0.8,"baseColorFactor":[0.871,0.578,0.305,1]}}],
"animations":anims,"accessors":acc,"bufferViews":views,"buffers":[{"byteLength":len(buf),"uri":"data:application/octet-stream;base64,"+base64.b64encode(bytes(buf)).decode()}]}
out=json.dumps(j,separators=(",",":"))
pathlib.Path(__file__).with_name("face.gltf").write_text(out + "\n")
